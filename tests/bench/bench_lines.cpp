// Line segments beside OpenCV's LSD: time, repeatability under known homographies, and how often
// the nearest descriptor is the right one.
//   bench_lines [--images N] [FOLDER...]     N images of each folder; without one, generated walls
// Repeatability: the share of the lines of an image that are found again in the warped image, among
// those that lie in it and are still long enough; found means at most 2 px beside at both ends of
// the overlap, which covers half of the longer of the two; each line is found once.
// Times are of the same images in one run, one detector after the other, in units of cv::ORB(1500).

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "base/hamming.h"
#include "capture/decode.h"
#include "capture/folder_source.h"
#include "features/image_pyramid.h"
#include "features/line_extractor.h"
#include "support/scene_image.h"

namespace {

using namespace loopd;

constexpr double kMaxDistancePx = 2;
constexpr double kMinOverlap = 0.5;
constexpr double kMarginPx = 8;

struct Found {
  std::vector<Line> lines;
  std::vector<Descriptor> descriptors;  // empty: the detector describes nothing
};

LumaView view_of(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

double length_of(const Line& l) {
  return std::hypot(l.end_x_px - l.start_x_px, l.end_y_px - l.start_y_px);
}

// OpenCV's LSD with the same choice of lines as ours: the longest that are long enough.
class Reference {
 public:
  Found detect(const cv::Mat& image) {
    detector_->detect(image, segments_);
    Found found;
    const double min_length = config_.min_line_length * std::min(image.cols, image.rows);
    for (const cv::Vec4f& s : segments_)
      if (const Line line{s[0], s[1], s[2], s[3]}; length_of(line) >= min_length)
        found.lines.push_back(line);
    std::stable_sort(found.lines.begin(), found.lines.end(),
                     [](const Line& a, const Line& b) { return length_of(a) > length_of(b); });
    if (found.lines.size() > static_cast<std::size_t>(config_.lines))
      found.lines.resize(static_cast<std::size_t>(config_.lines));
    return found;
  }

 private:
  FeaturesConfig config_;
  cv::Ptr<cv::LineSegmentDetector> detector_ =
      cv::createLineSegmentDetector(cv::LSD_REFINE_STD, 0.8);
  std::vector<cv::Vec4f> segments_;
};

class Ours {
 public:
  Found detect(const cv::Mat& image) {
    Found found;
    pyramid_.start(view_of(image), FeaturesConfig{}.scale_factor, 2);
    pyramid_.build_next();
    extractor_.extract(pyramid_.level(1), image.cols, image.rows, found.lines, found.descriptors);
    return found;
  }

 private:
  ImagePyramid pyramid_;
  LineExtractor extractor_{FeaturesConfig{}};
};

// ---- Images and what is done to them ----

cv::Mat load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  const std::span<const std::uint8_t> data{reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                           bytes.size()};
  ImageDecoder decoder(100'000'000);
  const auto size = decoder.size(data);
  if (!size) return {};
  cv::Mat image(size.value().height_px, size.value().width_px, CV_8UC1);
  if (!decoder.decode(data, {image.data, size.value().pixels()})) return {};
  return image;
}

std::vector<cv::Mat> images_of(const std::string& folder, std::size_t count) {
  std::vector<cv::Mat> images;
  const auto paths = list_images(folder);
  if (!paths) {
    std::fprintf(stderr, "bench_lines: %s\n", paths.error().message.c_str());
    std::exit(2);
  }
  const std::size_t n = paths.value().size();
  for (std::size_t i = 0; i < std::min(count, n); ++i)
    if (cv::Mat image = load(paths.value()[i * n / std::min(count, n)]); !image.empty())
      images.push_back(image);
  return images;
}

std::vector<cv::Mat> walls(std::size_t count) {
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < count; ++i) {
    auto wall = testing::wall_image(static_cast<unsigned>(i + 1), 0, 640, 480);
    wall = testing::with_noise(std::move(wall), 3, static_cast<unsigned>(i));
    images.push_back(cv::Mat(480, 640, CV_8UC1, wall.pixels.data()).clone());
  }
  return images;
}

struct Warp {
  const char* name;
  double angle_deg = 0;
  double scale = 1;
  double perspective = 0;  // of the depth at the image's right edge
  double gain = 1;
  double noise = 0;
};

constexpr Warp kWarps[] = {
    {.name = "shift", .angle_deg = 1, .scale = 1.0},
    {.name = "rotate 10", .angle_deg = 10},
    {.name = "rotate 45", .angle_deg = 45},
    {.name = "scale 0.8", .scale = 0.8},
    {.name = "scale 1.25", .scale = 1.25},
    {.name = "perspective", .angle_deg = 3, .perspective = 0.25},
    {.name = "light, noise", .angle_deg = 2, .gain = 0.7, .noise = 6},
};

// Around the image's centre; a part of a pixel of shift in any case, so that no pixel is copied.
cv::Matx33d homography(const Warp& warp, cv::Size size) {
  const double cx = 0.5 * size.width;
  const double cy = 0.5 * size.height;
  const double a = warp.angle_deg * CV_PI / 180;
  const cv::Matx33d to_centre(1, 0, -cx, 0, 1, -cy, 0, 0, 1);
  const cv::Matx33d back(1, 0, cx + 3.4, 0, 1, cy - 2.3, 0, 0, 1);
  const cv::Matx33d turn(warp.scale * std::cos(a), -warp.scale * std::sin(a), 0,
                         warp.scale * std::sin(a), warp.scale * std::cos(a), 0, 0, 0, 1);
  const cv::Matx33d tilt(1, 0, 0, 0, 1, 0, warp.perspective / cx, 0, 1);
  return back * tilt * turn * to_centre;
}

cv::Mat warped(const cv::Mat& image, const Warp& warp, const cv::Matx33d& h, int seed) {
  cv::Mat out;
  // Shrinking by a camera sees no aliasing.
  cv::Mat in = image;
  if (warp.scale < 1)
    cv::GaussianBlur(image, in, {}, 0.5 * std::sqrt(1 / (warp.scale * warp.scale) - 1));
  cv::warpPerspective(in, out, h, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  if (warp.gain != 1) out.convertTo(out, -1, warp.gain, 20);
  if (warp.noise > 0) {
    cv::RNG random(static_cast<std::uint64_t>(seed) + 1);
    cv::Mat noise(out.size(), CV_16SC1);
    random.fill(noise, cv::RNG::NORMAL, 0, warp.noise);
    cv::add(out, noise, out, cv::noArray(), CV_8U);
  }
  return out;
}

// ---- What is found again ----

cv::Point2d moved(const cv::Matx33d& h, double x, double y) {
  const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
  return {p[0] / p[2], p[1] / p[2]};
}

bool inside(cv::Point2d p, cv::Size size) {
  return p.x >= kMarginPx && p.y >= kMarginPx && p.x < size.width - kMarginPx &&
         p.y < size.height - kMarginPx;
}

struct Segment {
  cv::Point2d a;
  cv::Point2d b;
  double length() const { return cv::norm(b - a); }
};

bool same_line(const Segment& s, const Segment& t) {
  const double length = t.length();
  const cv::Point2d along = (t.b - t.a) / length;
  const cv::Point2d normal(-along.y, along.x);
  double from = along.dot(s.a - t.a);
  double to = along.dot(s.b - t.a);
  double from_beside = normal.dot(s.a - t.a);
  double to_beside = normal.dot(s.b - t.a);
  if (from > to) {
    std::swap(from, to);
    std::swap(from_beside, to_beside);
  }
  const double lo = std::max(from, 0.0);
  const double hi = std::min(to, length);
  if (hi - lo < kMinOverlap * std::max(length, s.length())) return false;
  const auto beside = [&](double at) {
    return from_beside + (to_beside - from_beside) * (at - from) / (to - from);
  };
  return std::abs(beside(lo)) <= kMaxDistancePx && std::abs(beside(hi)) <= kMaxDistancePx;
}

struct Score {
  double eligible = 0;
  double found = 0;
  double described = 0;  // the nearest descriptor of the other image is of the same line
  double distance_bits = 0;
  double directed = 0;  // start at start
  void add(const Score& s) {
    eligible += s.eligible;
    found += s.found;
    described += s.described;
    distance_bits += s.distance_bits;
    directed += s.directed;
  }
};

std::size_t nearest(const Descriptor& query, const std::vector<Descriptor>& others) {
  std::vector<std::uint16_t> distances(others.size());
  hamming_distances(query, others, distances);
  return static_cast<std::size_t>(std::min_element(distances.begin(), distances.end()) -
                                  distances.begin());
}

Score score(const Found& first, const Found& second, const cv::Matx33d& h, cv::Size size) {
  const double min_length =
      1.25 * FeaturesConfig{}.min_line_length * std::min(size.width, size.height);
  std::vector<Segment> targets;
  std::vector<bool> taken(second.lines.size());
  for (const Line& l : second.lines)
    targets.push_back({{l.start_x_px, l.start_y_px}, {l.end_x_px, l.end_y_px}});
  Score score;
  for (std::size_t i = 0; i < first.lines.size(); ++i) {
    const Line& l = first.lines[i];
    const Segment s{moved(h, l.start_x_px, l.start_y_px), moved(h, l.end_x_px, l.end_y_px)};
    if (!inside(s.a, size) || !inside(s.b, size) || s.length() < min_length) continue;
    if (!inside({l.start_x_px, l.start_y_px}, size) || !inside({l.end_x_px, l.end_y_px}, size))
      continue;
    score.eligible += 1;
    std::size_t hit = targets.size();
    for (std::size_t k = 0; k < targets.size() && hit == targets.size(); ++k)
      if (!taken[k] && same_line(s, targets[k])) hit = k;
    if (hit == targets.size()) continue;
    taken[hit] = true;
    score.found += 1;
    if ((s.b - s.a).dot(targets[hit].b - targets[hit].a) > 0) score.directed += 1;
    if (first.descriptors.empty()) continue;
    const std::size_t n = nearest(first.descriptors[i], second.descriptors);
    if (same_line(s, targets[n])) score.described += 1;
    score.distance_bits += hamming_distance(first.descriptors[i], second.descriptors[hit]);
  }
  return score;
}

// ---- Time ----

template <class Call>
double milliseconds(const Call& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

struct Times {
  std::vector<double> ms;
  double median() const {
    auto sorted = ms;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }
  double mean() const {
    double sum = 0;
    for (const double t : ms) sum += t;
    return sum / static_cast<double>(ms.size());
  }
};

void measure_time(const std::vector<cv::Mat>& images) {
  const auto orb = cv::ORB::create(1500);
  std::vector<cv::KeyPoint> points;
  cv::Mat table;
  Ours ours;
  Reference reference;
  Times orb_ms;
  Times ours_ms;
  Times reference_ms;
  for (int round = 0; round < 4; ++round)
    for (const cv::Mat& image : images) {
      const double a = milliseconds([&] { orb->detectAndCompute(image, {}, points, table); });
      const double b = milliseconds([&] { ours.detect(image); });
      const double c = milliseconds([&] { reference.detect(image); });
      if (round == 0) continue;  // warming up
      orb_ms.ms.push_back(a);
      ours_ms.ms.push_back(b);
      reference_ms.ms.push_back(c);
    }
  const auto print = [&](const char* name, const Times& t) {
    std::printf("  %-28s mean %7.2f  median %7.2f ms  %5.2f x ORB\n", name, t.mean(), t.median(),
                t.median() / orb_ms.median());
  };
  print("cv::ORB(1500)", orb_ms);
  print("lines and descriptors", ours_ms);
  print("OpenCV's LSD, lines alone", reference_ms);
}

void measure_repeatability(const std::vector<cv::Mat>& images) {
  Ours ours;
  Reference reference;
  Score all_ours;
  Score all_reference;
  double lines_ours = 0;
  double lines_reference = 0;
  std::printf("  %-14s %8s %8s   %s\n", "found again, %", "ours", "LSD",
              "ours: nearest descriptor right, bits, directed");
  const auto share = [](double part, double whole) { return whole > 0 ? 100 * part / whole : 0; };
  const auto print = [&](const char* name, const Score& o, const Score& r) {
    std::printf(
        "  %-14s %8.1f %8.1f   %5.1f %% %5.1f bits %6.1f %%   (%.0f of %.0f, LSD %.0f of %.0f)\n",
        name, share(o.found, o.eligible), share(r.found, r.eligible), share(o.described, o.found),
        o.distance_bits / std::max(1.0, o.found), share(o.directed, o.found), o.found, o.eligible,
        r.found, r.eligible);
  };
  for (const Warp& warp : kWarps) {
    Score sum_ours;
    Score sum_reference;
    int seed = 0;
    for (const cv::Mat& image : images) {
      const cv::Matx33d h = homography(warp, image.size());
      const cv::Mat other = warped(image, warp, h, seed++);
      const Found a = ours.detect(image);
      const Found b = reference.detect(image);
      lines_ours += static_cast<double>(a.lines.size());
      lines_reference += static_cast<double>(b.lines.size());
      sum_ours.add(score(a, ours.detect(other), h, image.size()));
      sum_reference.add(score(b, reference.detect(other), h, image.size()));
    }
    print(warp.name, sum_ours, sum_reference);
    all_ours.add(sum_ours);
    all_reference.add(sum_reference);
  }
  print("all", all_ours, all_reference);
  const auto n = static_cast<double>(images.size() * std::size(kWarps));
  std::printf("  lines an image: %.1f, LSD %.1f\n", lines_ours / n, lines_reference / n);
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  std::size_t count = 12;
  std::vector<std::string> folders;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--images" && i + 1 < argc)
      count = static_cast<std::size_t>(std::max(1, std::atoi(argv[++i])));
    else
      folders.emplace_back(argv[i]);
  }
  const auto measure = [](const char* name, const std::vector<cv::Mat>& images) {
    std::printf("%s: %zu images\n", name, images.size());
    if (images.empty()) return;
    measure_time(images);
    measure_repeatability(images);
  };
  if (folders.empty()) measure("generated walls", walls(count));
  for (const std::string& folder : folders) measure(folder.c_str(), images_of(folder, count));
  return 0;
}
