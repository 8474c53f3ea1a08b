#include "verify/scene.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace loopd::testing {
namespace {

const Mat3 kCamera{kFocal, 0, (kWidth - 1) / 2.0, 0, kFocal, (kHeight - 1) / 2.0, 0, 0, 1};
const Vec3 kWallNormal{0.3, -0.2, 1};
constexpr double kWallDistance = 8;

Mat3 inverse(const Mat3& a) {
  Mat3 out = adjugate(a);
  const double det = determinant(a);
  for (double& x : out) x /= det;
  return out;
}

Mat3 rotation_of(const SceneOptions& o) {
  const double cz = std::cos(o.roll_rad), sz = std::sin(o.roll_rad);
  const double cx = std::cos(o.pitch_rad), sx = std::sin(o.pitch_rad);
  const double cy = std::cos(o.yaw_rad), sy = std::sin(o.yaw_rad);
  const Mat3 z{cz, -sz, 0, sz, cz, 0, 0, 0, 1};
  const Mat3 x{1, 0, 0, 0, cx, -sx, 0, sx, cx};
  const Mat3 y{cy, 0, sy, 0, 1, 0, -sy, 0, cy};
  return multiply(z, multiply(x, y));
}

struct Pixel {
  double x, y;
};

// A feature's place in both images.
struct Seen {
  Pixel query, match;
  bool in_match;
};

class World {
 public:
  explicit World(const SceneOptions& o)
      : o_(o), random_(o.seed), rotation_(rotation_of(o)), back_(inverse(kCamera)) {}

  Random& random() { return random_; }

  Pixel somewhere() { return {uniform(random_, 5, kWidth - 5), uniform(random_, 5, kHeight - 5)}; }

  double depth(const Pixel& p) {
    const Vec3 ray = multiply(back_, Vec3{p.x, p.y, 1});
    return o_.planar ? kWallDistance / dot(kWallNormal, ray) : uniform(random_, 4, 20);
  }

  Seen see(const Pixel& p, double depth_m) const {
    const Vec3 ray = multiply(back_, Vec3{p.x, p.y, 1});
    Vec3 at = multiply(rotation_, Vec3{ray[0] * depth_m, ray[1] * depth_m, ray[2] * depth_m});
    for (std::size_t i = 0; i < 3; ++i) at[i] += o_.translation[i];
    const Vec3 image = multiply(kCamera, at);
    const Pixel m{image[0] / image[2], image[1] / image[2]};
    const bool inside =
        at[2] > 0.1 && m.x >= 0 && m.y >= 0 && m.x <= kWidth - 1 && m.y <= kHeight - 1;
    return {p, m, inside};
  }

  Pixel noisy(const Pixel& p) {
    return {p.x + normal(random_, o_.noise_px), p.y + normal(random_, o_.noise_px)};
  }

  Mat3 fundamental() const {
    const Mat3 essential = multiply(cross_matrix(o_.translation), rotation_);
    return unit_norm(multiply(transpose(back_), multiply(essential, back_)));
  }

  Mat3 homography() const {
    Mat3 h = rotation_;
    if (o_.planar)
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c)
          h[r * 3 + c] += o_.translation[r] * kWallNormal[c] / kWallDistance;
    return unit_norm(multiply(kCamera, multiply(h, back_)));
  }

 private:
  SceneOptions o_;
  Random random_;
  Mat3 rotation_;
  Mat3 back_;
};

void add_point(World& world, const SceneOptions& o, Scene& scene) {
  Seen seen{};
  do {
    const Pixel p = world.somewhere();
    seen = world.see(p, world.depth(p));
  } while (!seen.in_match);
  Random& random = world.random();
  const bool is_true = uniform(random, 0, 1) >= o.outliers;
  const Pixel q = world.noisy(seen.query);
  const Pixel m = is_true ? world.noisy(seen.match) : world.somewhere();
  Point query = point_at(q.x, q.y), match = point_at(m.x, m.y);
  query.angle_deg = static_cast<float>(uniform(random, 0, 360));
  const double turned =
      is_true ? query.angle_deg + o.roll_rad * 180 / std::acos(-1.0) + normal(random, 3)
              : uniform(random, 0, 360);
  match.angle_deg = static_cast<float>(std::fmod(turned + 720, 360));
  scene.query.points.push_back(query);
  scene.match.points.push_back(match);
  const Descriptor d = random_descriptor(random);
  scene.query.point_descriptors.push_back(d);
  scene.match.point_descriptors.push_back(flipped(d, o.flipped_bits, random));
  scene.point_true.push_back(is_true);
}

Line line_between(const Pixel& a, const Pixel& b) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(b.x),
          static_cast<float>(b.y)};
}

Pixel between(const Pixel& a, const Pixel& b, double share) {
  return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)};
}

void add_line(World& world, const SceneOptions& o, Scene& scene) {
  Random& random = world.random();
  Seen a{}, b{};
  do {
    const Pixel p = world.somewhere();
    const double angle = uniform(random, 0, 2 * std::acos(-1.0)), length = uniform(random, 40, 150);
    const Pixel q{p.x + length * std::cos(angle), p.y + length * std::sin(angle)};
    const bool inside = q.x > 0 && q.y > 0 && q.x < kWidth - 1 && q.y < kHeight - 1;
    if (!inside) continue;
    const double depth = world.depth(p);
    a = world.see(p, depth);
    b = world.see(q, o.planar ? world.depth(q) : depth * uniform(random, 0.9, 1.1));
  } while (!a.in_match || !b.in_match);
  const bool is_true = uniform(random, 0, 1) >= o.outliers;
  scene.query.lines.push_back(line_between(world.noisy(a.query), world.noisy(b.query)));
  const bool start_slides = random.below(2) == 0;
  const double slide = uniform(random, 0, o.slide);
  const Pixel start = between(a.match, b.match, start_slides ? slide : 0);
  const Pixel end = between(b.match, a.match, start_slides ? 0 : slide);
  const Pixel off = world.somewhere();  // an outlier keeps its direction but lies elsewhere
  scene.match.lines.push_back(
      is_true ? line_between(world.noisy(start), world.noisy(end))
              : line_between(off, {off.x + end.x - start.x, off.y + end.y - start.y}));
  const Descriptor d = random_descriptor(random);
  scene.query.line_descriptors.push_back(d);
  scene.match.line_descriptors.push_back(flipped(d, o.flipped_bits, random));
  scene.line_true.push_back(is_true);
}

// Reorders the match image's features; partner[i] becomes the place of query feature i's partner.
template <class Feature>
std::vector<std::size_t> shuffle(std::vector<Feature>& features, std::vector<Descriptor>& words,
                                 Random& random) {
  std::vector<std::size_t> partner(features.size());
  std::iota(partner.begin(), partner.end(), std::size_t{0});
  for (std::size_t i = features.size(); i > 1; --i)
    std::swap(partner[i - 1], partner[random.below(i)]);
  std::vector<Feature> new_features(features.size());
  std::vector<Descriptor> new_words(words.size());
  for (std::size_t i = 0; i < features.size(); ++i) {
    new_features[partner[i]] = features[i];
    new_words[partner[i]] = words[i];
  }
  features = std::move(new_features);
  words = std::move(new_words);
  return partner;
}

}  // namespace

double normal(Random& random, double sigma) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += uniform(random, 0, 1);
  return sigma * sum;
}

Descriptor random_descriptor(Random& random) {
  Descriptor d;
  for (auto& word : d.words) word = random.next();
  return d;
}

Descriptor flipped(const Descriptor& original, int bits, Random& random) {
  Descriptor d = original;
  for (int done = 0; done < bits;) {
    const std::size_t bit = random.below(256);
    const std::uint64_t mask = std::uint64_t{1} << (bit % 64);
    if ((d.words[bit / 64] ^ original.words[bit / 64]) & mask) continue;
    d.words[bit / 64] ^= mask;
    ++done;
  }
  return d;
}

Point point_at(double x, double y) {
  return {static_cast<float>(x), static_cast<float>(y), 31.0F, 0.0F};
}

std::size_t Scene::true_points() const {
  return static_cast<std::size_t>(std::count(point_true.begin(), point_true.end(), true));
}

std::size_t Scene::true_lines() const {
  return static_cast<std::size_t>(std::count(line_true.begin(), line_true.end(), true));
}

Scene make_scene(const SceneOptions& options) {
  World world(options);
  Scene scene;
  for (Features* f : {&scene.query, &scene.match}) {
    f->width_px = kWidth;
    f->height_px = kHeight;
  }
  for (int i = 0; i < options.points; ++i) add_point(world, options, scene);
  for (int i = 0; i < options.lines; ++i) add_line(world, options, scene);
  scene.point_partner = shuffle(scene.match.points, scene.match.point_descriptors, world.random());
  scene.line_partner = shuffle(scene.match.lines, scene.match.line_descriptors, world.random());
  scene.fundamental = world.fundamental();
  scene.homography = world.homography();
  return scene;
}

Features random_features(int points, int lines, std::uint64_t seed) {
  SceneOptions options;
  options.points = points;
  options.lines = lines;
  options.seed = seed;
  return make_scene(options).query;
}

double epipolar_distance(const Mat3& f, double qx, double qy, double x, double y) {
  const Vec3 line = multiply(f, Vec3{qx, qy, 1});
  return std::abs(line[0] * x + line[1] * y + line[2]) /
         std::sqrt(line[0] * line[0] + line[1] * line[1]);
}

}  // namespace loopd::testing
