#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "make_sequence/sequence.h"
#include "support/temp_dir.h"

namespace loopd::sequence {
namespace {

namespace fs = std::filesystem;
using loopd::testing::TempDir;
using ::testing::HasSubstr;
using ::testing::Not;

SequenceOptions small_options() {
  SequenceOptions o;
  o.frames = 30;
  o.step_m = 2;
  o.width_px = 80;
  o.height_px = 60;
  o.gap = 10;
  return o;
}

std::string slurp(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  EXPECT_TRUE(in) << path;
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Every file below `folder` with its bytes.
std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> out;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) out[entry.path().lexically_relative(folder)] = slurp(entry);
  }
  return out;
}

/// A pose as a reader of poses.tum gets it.
struct TumPose {
  double time, x, y, z, qx, qy, qz, qw;
  /// camera_from_world applied to a point: the quaternion's conjugate turns the difference.
  Vec3 to_camera(const Vec3& p) const {
    const double v[3] = {p.x - x, p.y - y, p.z - z};
    const double u[3] = {-qx, -qy, -qz};
    const auto cross = [](const double* a, const double* b, double* out) {
      out[0] = a[1] * b[2] - a[2] * b[1];
      out[1] = a[2] * b[0] - a[0] * b[2];
      out[2] = a[0] * b[1] - a[1] * b[0];
    };
    double t[3];
    double c[3];
    cross(u, v, t);
    for (double& component : t) component *= 2;
    cross(u, t, c);
    return {v[0] + qw * t[0] + c[0], v[1] + qw * t[1] + c[1], v[2] + qw * t[2] + c[2]};
  }
  /// Optical axis in the world.
  Vec3 forward() const {
    return {2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)};
  }
};

std::vector<TumPose> read_poses(const fs::path& path) {
  std::istringstream in(slurp(path));
  std::vector<TumPose> poses;
  TumPose p{};
  while (in >> p.time >> p.x >> p.y >> p.z >> p.qx >> p.qy >> p.qz >> p.qw) poses.push_back(p);
  return poses;
}

TEST(MakeSequence, SameOptionsGiveSameBytesOnAnyNumberOfThreads) {
  const TempDir dir;
  ASSERT_TRUE(write_sequence(small_options(), dir / "a", 1, {}).ok());
  ASSERT_TRUE(write_sequence(small_options(), dir / "b", 3, {}).ok());
  const auto a = contents(dir / "a");
  EXPECT_EQ(a.size(), 34U);  // 30 images, groundtruth.csv, poses.tum, camera.json, info.json
  EXPECT_EQ(a, contents(dir / "b"));

  SequenceOptions other = small_options();
  other.seed = 2;
  ASSERT_TRUE(write_sequence(other, dir / "c", 2, {}).ok());
  EXPECT_NE(a.at("images/000003.png"), slurp(dir / "c/images/000003.png"));
}

TEST(MakeSequence, GroundTruthFollowsFromThePoses) {
  const TempDir dir;
  SequenceOptions options = small_options();
  options.frames = 130;
  options.step_m = 0.7;
  options.parked = 15;
  options.width_px = options.height_px = 16;
  ASSERT_TRUE(write_sequence(options, dir / "s", 2, {}).ok());
  const auto poses = read_poses(dir / "s/poses.tum");
  ASSERT_EQ(poses.size(), 145U);
  const auto walked = [](int i) { return std::max(0, i - 15) * 0.7; };
  std::string expected = "query,match,label\n";
  int same = 0;
  for (int i = 0; i < 145; ++i) {
    for (int j = 0; j < i; ++j) {
      const TumPose& a = poses[static_cast<std::size_t>(i)];
      const TumPose& b = poses[static_cast<std::size_t>(j)];
      const double metres = std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
      const double degrees =
          std::acos(std::min(1.0, dot(a.forward(), b.forward()))) * 180 / std::acos(-1.0);
      if (metres > 3 || degrees > 60) continue;
      const bool is_same =
          metres <= 1.5 && degrees <= 35 && i - j >= 10 && walked(i) - walked(j) >= 10;
      same += is_same ? 1 : 0;
      expected += std::to_string(i) + "," + std::to_string(j) + (is_same ? ",1\n" : ",0.5\n");
    }
  }
  EXPECT_GT(same, 65) << "the second lap sees the first";
  EXPECT_EQ(slurp(dir / "s/groundtruth.csv"), expected);
}

TEST(MakeSequence, SecondLapLooksLikeTheFirst) {
  SequenceOptions options = small_options();
  options.frames = 80;
  options.step_m = 0.7;
  options.noise = 0;
  options.exposure = 0;
  options.offset_m = 0;
  const Sequence sequence(options);
  FrameRenderer renderer(sequence);
  const auto difference = [&](std::size_t i, std::size_t j) {
    const std::vector<std::uint8_t> a = renderer.render(i);
    const std::vector<std::uint8_t>& b = renderer.render(j);
    double sum = 0;
    for (std::size_t k = 0; k < a.size(); ++k) sum += std::abs(a[k] - b[k]);
    return sum / static_cast<double>(a.size());
  };
  double near = 0;
  double far = 0;
  for (std::size_t i = 2; i < 38; i += 3) {
    near += difference(i, i + 40);
    far += difference(i, (i + 17) % 40 + 40);
  }
  EXPECT_LT(near, 0.6 * far) << near << " against " << far;
}

/// Renders with and without a small white patch at a known place of a wall; the centre of what
/// differs must lie where poses.tum and camera.json project that place.
TEST(MakeSequence, KnownPointsProjectWhereTheFilesSay) {
  const TempDir dir;
  SequenceOptions options = small_options();
  options.width_px = 320;
  options.height_px = 240;
  options.frames = 16;
  options.step_m = 4;
  ASSERT_TRUE(write_sequence(options, dir / "s", 2, {}).ok());
  const auto poses = read_poses(dir / "s/poses.tum");
  const auto camera = nlohmann::json::parse(slurp(dir / "s/camera.json"));
  const Sequence sequence(options);
  Scene plain = sequence.scene();
  plain.boxes.clear();  // nothing may stand before the patch
  int checked = 0;
  for (std::size_t w = 0; w < plain.walls.size(); ++w) {
    const Wall& wall = plain.walls[w];
    const double along = (wall.lo + wall.hi) / 2;
    const double u = wall.u_sign() * along;
    const Vec3 point = wall.axis == 0 ? Vec3{wall.at, along, 1.6} : Vec3{along, wall.at, 1.6};
    Scene marked = plain;
    marked.pictures.emplace_back(Canvas(8, 8, 255));
    marked.walls[w].decals.push_back(
        {u - 0.03, u + 0.03, 1.57, 1.63, marked.pictures.size() - 1, 1, false});
    Renderer before(plain, sequence.camera());
    Renderer after(marked, sequence.camera());
    Radiance a;
    Radiance b;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Vec3 c = poses[k].to_camera(point);
      const double x = camera["fx"].get<double>() * c.x / c.z + camera["cx"].get<double>();
      const double y = camera["fy"].get<double>() * c.y / c.z + camera["cy"].get<double>();
      if (c.z < 0.8 || c.z > 6 || x < 20 || x > 300 || y < 20 || y > 220) continue;
      before.render(sequence.plan()[k].pose, 0, a);
      after.render(sequence.plan()[k].pose, 0, b);
      double sum = 0;
      double sum_x = 0;
      double sum_y = 0;
      for (std::size_t i = 0; i < a.size(); ++i) {
        const double d = b[i] - a[i];
        sum += d;
        sum_x += d * static_cast<double>(i % 320);
        sum_y += d * static_cast<double>(i / 320);
      }
      if (sum < 100) continue;  // behind a corner
      EXPECT_NEAR(sum_x / sum, x, 0.25) << "wall " << w << ", frame " << k;
      EXPECT_NEAR(sum_y / sum, y, 0.25) << "wall " << w << ", frame " << k;
      ++checked;
    }
  }
  EXPECT_GE(checked, 4);
}

TEST(MakeSequence, ParkedFramesDifferByNoiseOnly) {
  SequenceOptions options = small_options();
  options.frames = 0;
  options.parked = 3;
  const Sequence noisy(options);
  FrameRenderer renderer(noisy);
  const auto first = renderer.render(0);
  EXPECT_NE(first, renderer.render(1));
  options.noise = 0;
  const Sequence still(options);
  FrameRenderer clean(still);
  const auto again = clean.render(0);
  EXPECT_EQ(again, clean.render(2));
}

TEST(MakeSequence, WritesTimesAndJpegWhenAsked) {
  const TempDir dir;
  SequenceOptions options = small_options();
  options.fps = 4;
  options.format = ImageFormat::kJpeg;
  ASSERT_TRUE(write_sequence(options, dir / "s", 1, {}).ok());
  EXPECT_THAT(slurp(dir / "s/times.txt"), ::testing::StartsWith("0.000000\n0.250000\n"));
  EXPECT_EQ(slurp(dir / "s/images/000029.jpg").substr(0, 2), "\xff\xd8");
  const auto info = nlohmann::json::parse(slurp(dir / "s/info.json"));
  EXPECT_EQ(info["options"]["fps"], 4);
  EXPECT_EQ(info["images"], 30);
}

TEST(MakeSequence, NamesEveryViolation) {
  SequenceOptions o = small_options();
  o.frames = -1;
  o.width_px = 0;
  o.fov_deg = std::nan("");
  o.texture = 1.5;
  o.sameness = -0.5;
  o.jpeg_quality = 101;
  const TempDir dir;
  const Status status = write_sequence(o, dir / "s", 1, {});
  ASSERT_FALSE(status.ok());
  for (const char* name : {"frames = -1", "width = 0", "fov = nan", "texture = 1.5",
                           "sameness = -0.5", "jpeg-quality = 101"}) {
    EXPECT_THAT(status.error().message, HasSubstr(name));
  }
  EXPECT_FALSE(fs::exists(dir / "s"));
}

TEST(MakeSequence, RefusesNothingToRenderAndLoopsOutOfRange) {
  SequenceOptions o = small_options();
  o.frames = 0;
  EXPECT_THAT(validate(o), ::testing::ElementsAre(HasSubstr("nothing to render")));
  o.frames = 3;
  EXPECT_THAT(validate(o), ::testing::ElementsAre(HasSubstr("the loop would be")));
  o.frames = 1'000'000;
  EXPECT_THAT(validate(o), ::testing::ElementsAre(HasSubstr("the loop would be")));
  o.loop_m = 60;
  EXPECT_THAT(validate(o), ::testing::IsEmpty());
}

TEST(MakeSequence, RefusesAFolderItCannotMakeOrThatHoldsOtherImages) {
  const TempDir dir;
  dir.write("file", "x");
  const Status below_file = write_sequence(small_options(), dir / "file/out", 1, {});
  ASSERT_FALSE(below_file.ok());
  EXPECT_THAT(below_file.error().message, HasSubstr("file/out"));

  dir.write("used/images/holiday.png", "x");
  const Status used = write_sequence(small_options(), dir / "used", 1, {});
  ASSERT_FALSE(used.ok());
  EXPECT_THAT(used.error().message, HasSubstr("holiday.png"));
  EXPECT_EQ(contents(dir / "used").size(), 1U);
}

TEST(MakeSequence, AnImageThatCannotBeWrittenIsAnError) {
  const TempDir dir;
  fs::create_directories(dir / "s/images/000004.png/blocked");
  const Status status = write_sequence(small_options(), dir / "s", 2, {});
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("000004.png"));
}

/// Runs the tool with `arguments`; its exit code and what it printed.
std::pair<int, std::string> run_tool(const std::string& arguments) {
  FILE* pipe = popen((std::string(LOOPD_MAKE_SEQUENCE) + " " + arguments + " 2>&1").c_str(), "r");
  std::string text;
  char buffer[4096];
  for (std::size_t n = 0; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) text.append(buffer, n);
  const int code = pclose(pipe);
  return {WIFEXITED(code) ? WEXITSTATUS(code) : -1, text};
}

TEST(MakeSequenceTool, RendersAndReportsProgress) {
  const TempDir dir;
  const auto [code, text] = run_tool("--out " + (dir / "s").string() +
                                     " --frames 26 --step 2 --width 32 --height 24 --texture 0.3"
                                     " --lap-change --format jpg --threads 2 --sameness 0.5");
  EXPECT_EQ(code, 0) << text;
  EXPECT_THAT(text, HasSubstr("26 of 26 images\n"));
  EXPECT_THAT(text, Not(HasSubstr("\r"))) << "a log is no terminal";
  EXPECT_TRUE(fs::exists(dir / "s/images/000025.jpg"));
  EXPECT_EQ(nlohmann::json::parse(slurp(dir / "s/info.json"))["options"]["sameness"], 0.5);
}

TEST(MakeSequenceTool, HostileOptionsGiveClearErrors) {
  const TempDir dir;
  const std::string out = "--out " + (dir / "s").string();
  for (const auto& [arguments, sentence] :
       std::map<std::string, std::string>{{out + " --frames 0", "nothing to render"},
                                          {out + " --frames many", "--frames"},
                                          {out + " --format bmp", "--format"},
                                          {out + " --laps 2 --loop 50", "--loop"},
                                          {out + " --noise -1", "noise = -1"},
                                          {"--frames 30", "--out"}}) {
    const auto [code, text] = run_tool(arguments);
    EXPECT_NE(code, 0) << arguments;
    EXPECT_THAT(text, HasSubstr(sentence)) << arguments;
  }
}

}  // namespace
}  // namespace loopd::sequence
