#include "make_sequence/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "make_sequence/picture.h"
#include "make_sequence/random.h"
#include "make_sequence/sequence.h"

namespace loopd::sequence {
namespace {

SequenceOptions small_options() {
  SequenceOptions o;
  o.frames = 60;
  o.step_m = 1;
  o.width_px = 96;
  o.height_px = 72;
  o.noise = 0;
  o.blur_px = 0;
  o.exposure = 0;
  return o;
}

/// Depth of the nearest surface along a ray, by trying every wall and box of the scene.
double brute_depth(const Scene& scene, const Vec3& eye, const Vec3& d) {
  double best = d.z < 0 ? -eye.z / d.z : d.z > 0 ? (scene.height_m - eye.z) / d.z : 1e9;
  for (const Wall& wall : scene.walls) {
    const bool x_plane = wall.axis == 0;
    const double from = x_plane ? eye.x : eye.y;
    const double t = (wall.at - from) / (x_plane ? d.x : d.y);
    const double along = x_plane ? eye.y + t * d.y : eye.x + t * d.x;
    const bool facing = (from - wall.at) * wall.facing > 0;
    if (facing && t > 0 && t < best && along >= wall.lo && along <= wall.hi) best = t;
  }
  for (const Box& box : scene.boxes) {
    double enter = 0;
    double leave = 1e9;
    const double o[3] = {eye.x, eye.y, eye.z};
    const double v[3] = {d.x, d.y, d.z};
    const double lo[3] = {box.lo.x, box.lo.y, box.lo.z};
    const double hi[3] = {box.hi.x, box.hi.y, box.hi.z};
    for (int i = 0; i < 3; ++i) {
      const double a = (lo[i] - o[i]) / v[i];
      const double b = (hi[i] - o[i]) / v[i];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    if (enter > 0 && enter < leave && enter < best) best = enter;
  }
  return best;
}

TEST(Renderer, BinsHideNothingThatBruteForceSees) {
  SequenceOptions options = small_options();
  for (const double loop : {60.0, 300.0}) {
    options.loop_m = loop;
    const Sequence sequence(options);
    const Camera& camera = sequence.camera();
    Renderer renderer(sequence.scene(), camera);
    Radiance image;
    for (std::size_t k = 0; k < sequence.plan().size(); k += 4) {
      const Pose& pose = sequence.plan()[k].pose;
      renderer.render(pose, 0, image);
      for (int y = 0; y < camera.height_px; y += 3) {
        for (int x = 0; x < camera.width_px; ++x) {
          const Vec3 d = pose.forward + ((x - camera.cx_px) / camera.focal_px) * pose.right +
                         ((y - camera.cy_px) / camera.focal_px) * pose.down;
          const auto i = static_cast<std::size_t>(y * camera.width_px + x);
          const double truth = brute_depth(sequence.scene(), pose.position, d);
          ASSERT_NEAR(renderer.depths_m()[i], truth, 1e-4 * truth)
              << "frame " << k << ", pixel " << x << ", " << y;
        }
      }
    }
  }
}

TEST(Renderer, EveryPixelIsAPlausibleGrey) {
  SequenceOptions options = small_options();
  options.lap_change = true;
  const Sequence sequence(options);
  Renderer renderer(sequence.scene(), sequence.camera());
  Radiance image;
  for (std::size_t k = 0; k < sequence.plan().size(); k += 7) {
    renderer.render(sequence.plan()[k].pose, static_cast<int>(k), image);
    for (const float value : image) ASSERT_TRUE(value >= 0 && value < 400) << value;
    const auto [least, most] = std::minmax_element(image.begin(), image.end());
    EXPECT_GT(*most - *least, 60) << "frame " << k << " shows next to nothing";
  }
}

TEST(Picture, MeanIsTheMeanOfTheTexels) {
  Random random(5);
  Canvas canvas(37, 23, 0);
  for (int y = 0; y < 23; ++y) {
    for (int x = 0; x < 37; ++x) canvas.set(x, y, random.integer(0, 255));
  }
  const Picture picture(canvas);
  for (int trial = 0; trial < 200; ++trial) {
    const double x0 = random.uniform(-3, 36);
    const double y0 = random.uniform(-3, 22);
    const double x1 = x0 + random.uniform(0.1, 20);
    const double y1 = y0 + random.uniform(0.1, 20);
    double sum = 0;
    double area = 0;
    for (int y = 0; y < 23; ++y) {
      for (int x = 0; x < 37; ++x) {
        const double w = std::min(x + 1.0, x1) - std::max<double>(x, x0);
        const double h = std::min(y + 1.0, y1) - std::max<double>(y, y0);
        if (w <= 0 || h <= 0) continue;
        sum += w * h * canvas.at(x, y);
        area += w * h;
      }
    }
    if (area < 1e-2) continue;
    EXPECT_NEAR(picture.mean(x0, y0, x1, y1), sum / area, 1e-6);
  }
}

TEST(Picture, AnEmptyBoxIsAnswered) {
  Canvas canvas(4, 4, 77);
  const Picture picture(canvas);
  EXPECT_NEAR(picture.mean(2, 2, 2, 2), 77, 0.1);
  EXPECT_NEAR(picture.mean(9, -4, 12, -3), 77, 0.1);
}

TEST(Walk, IsClosedSmoothAndAsLongAsAsked) {
  for (const double loop : {24.0, 60.0, 130.0, 454.0}) {
    Random random(3);
    const Walk walk(make_floor_plan(loop, 1.0, random), 1.0);
    EXPECT_NEAR(walk.length_m(), loop, 1e-9);
    WalkPoint last = walk.at(0);
    for (double s = 0.05; s < 2 * loop; s += 0.05) {
      const WalkPoint here = walk.at(s);
      ASSERT_NEAR(std::hypot(here.x - last.x, here.y - last.y), 0.05, 1e-4) << "at " << s;
      ASSERT_GT(std::cos(here.heading_rad - last.heading_rad), 0.99) << "at " << s;
      last = here;
    }
    EXPECT_NEAR(walk.at(loop + 1).x, walk.at(1).x, 1e-9);
    EXPECT_NEAR(walk.at(loop + 1).y, walk.at(1).y, 1e-9);
  }
}

TEST(Scene, LoopsOfAnyLengthKeepTheirLegsApart) {
  for (const double loop : {24.0, 120.0, 454.0, 2000.0}) {
    Random random(9);
    const auto corners = make_floor_plan(loop, 1.0, random);
    const Walk walk(corners, 1.0);
    std::vector<WalkPoint> points;
    for (double s = 0; s < loop; s += 1) points.push_back(walk.at(s));
    const auto n = static_cast<int>(points.size());
    for (int i = 0; i < n; ++i) {
      for (int j = i + 6; j < n - 6; ++j) {
        const auto& a = points[static_cast<std::size_t>(i)];
        const auto& b = points[static_cast<std::size_t>(j)];
        if (std::min(j - i, n - j + i) < 8) continue;
        ASSERT_GT(std::hypot(a.x - b.x, a.y - b.y), 2.5) << loop << " m: " << i << ", " << j;
      }
    }
  }
}

TEST(Scene, TextureFadesPointsAndKeepsStructure) {
  const Scene rich = build_scene({60, 1, false, 4});
  const Scene poor = build_scene({60, 0.2, false, 4});
  const Scene bare = build_scene({60, 0, false, 4});
  const auto decals = [](const Scene& scene) {
    std::size_t count = 0;
    for (const Wall& wall : scene.walls) count += wall.decals.size();
    return count;
  };
  EXPECT_GT(decals(rich), decals(poor));
  EXPECT_GT(decals(poor), decals(bare));
  EXPECT_GT(decals(bare), 0U) << "doors stay";
  ASSERT_EQ(rich.boxes.size(), bare.boxes.size());
  for (std::size_t i = 0; i < rich.boxes.size(); ++i) {
    EXPECT_EQ(rich.boxes[i].lo.x, bare.boxes[i].lo.x);
    EXPECT_EQ(rich.boxes[i].hi.z, bare.boxes[i].hi.z);
  }
}

TEST(LegStyle, SamenessDrawsEveryValueTowardsTheCommonOne) {
  const LegStyle common;
  const auto values = [](const LegStyle& s) {
    return std::vector<double>{
        s.bay_m,          s.pillar_m,         s.pillar_depth_m, s.lamp_pitch_m,    s.lamp_aside_m,
        s.skirting_m,     s.rail_z_m,         s.door_height_m,  s.door_tone,       s.wall_tone,
        s.floor.size_x_m, s.ceiling.size_y_m, s.ceiling.x0_m,   s.grain.stretch_u, s.grain.u0_m};
  };
  for (std::size_t leg = 0; leg < 6; ++leg) {
    const auto own = values(make_leg_style(7, leg, 0));
    const auto half = values(make_leg_style(7, leg, 0.5));
    const auto next = values(make_leg_style(7, leg + 1, 0));
    EXPECT_EQ(values(make_leg_style(7, leg, 1)), values(common));
    EXPECT_EQ(values(make_leg_style(7, leg, 0)), own);
    for (std::size_t i = 0; i < own.size(); ++i) {
      const double to_own = std::abs(own[i] - values(common)[i]);
      EXPECT_LT(std::abs(half[i] - values(common)[i]), to_own) << "leg " << leg << ", value " << i;
      EXPECT_NE(own[i], next[i]) << "leg " << leg << ", value " << i;
    }
  }
}

TEST(LegMap, EveryPlaceOfTheFloorBelongsToItsLeg) {
  Random random(9);
  const auto corners = make_floor_plan(300, 1.0, random);
  const LegMap map(corners, 2.2);
  const std::size_t n = corners.size();
  for (std::size_t leg = 0; leg < n; ++leg) {
    const Vec3 along = corners[(leg + 1) % n] - corners[leg];
    const double length = std::abs(along.x) + std::abs(along.y);
    const Vec3 ahead = (1 / length) * along;
    const Vec3 left{-ahead.y, ahead.x, 0};
    for (double s = 1.15; s < length + 1.1; s += 0.2) {
      for (const double aside : {-1.05, 0.0, 1.05}) {
        const Vec3 p = corners[leg] + s * ahead + aside * left;
        ASSERT_EQ(map.leg_at(p.x, p.y), leg) << s << " m along, " << aside << " m aside";
      }
    }
  }
  EXPECT_LT(map.leg_at(1e6, -1e6), n);
  EXPECT_EQ(LegMap().leg_at(0, 0), 0U);
}

/// Distances from pillar to pillar along a wall; pillars are its boxes from floor to ceiling that
/// are wider than a duct.
std::vector<double> bay_pitches(const Scene& scene, const Wall& wall) {
  std::vector<double> centres;
  for (const Box& box : scene.boxes) {
    const bool x_plane = wall.axis == 0;
    const double near =
        wall.facing > 0 ? (x_plane ? box.lo.x : box.lo.y) : (x_plane ? box.hi.x : box.hi.y);
    const double lo = x_plane ? box.lo.y : box.lo.x;
    const double hi = x_plane ? box.hi.y : box.hi.x;
    const bool on_wall = near == wall.at && lo >= wall.lo && hi <= wall.hi;
    if (on_wall && box.lo.z == 0 && box.hi.z == scene.height_m && hi - lo > 0.1) {
      centres.push_back((lo + hi) / 2);
    }
  }
  std::sort(centres.begin(), centres.end());
  std::vector<double> pitches;
  for (std::size_t i = 1; i < centres.size(); ++i) pitches.push_back(centres[i] - centres[i - 1]);
  return pitches;
}

TEST(Scene, BaysRepeatWithinALegAndDifferBetweenLegsByTheSameness) {
  for (const double sameness : {0.0, 0.3, 1.0}) {
    const Scene scene = build_scene({120, 1, false, 4, sameness});
    std::vector<double> of_legs;
    for (const Wall& wall : scene.walls) {
      const auto pitches = bay_pitches(scene, wall);
      for (const double pitch : pitches) {
        EXPECT_NEAR(pitch, scene.legs[wall.leg].bay_m, 1e-9) << "leg " << wall.leg;
      }
      if (!pitches.empty()) of_legs.push_back(pitches.front());
    }
    ASSERT_GE(of_legs.size(), 6U);
    const auto [least, most] = std::minmax_element(of_legs.begin(), of_legs.end());
    if (sameness == 1) {
      EXPECT_NEAR(*most, *least, 1e-9);
    } else {
      EXPECT_GT(*most - *least, 0.3);
    }
  }
}

TEST(Scene, SamenessLeavesTheWayRoundAlone) {
  SequenceOptions options = small_options();
  options.sameness = 0;
  const Sequence own(options);
  options.sameness = 1;
  const Sequence copies(options);
  ASSERT_EQ(own.plan().size(), copies.plan().size());
  for (std::size_t i = 0; i < own.plan().size(); ++i) {
    EXPECT_EQ(own.plan()[i].pose.position.x, copies.plan()[i].pose.position.x);
    EXPECT_EQ(own.plan()[i].pose.forward.y, copies.plan()[i].pose.forward.y);
  }
  FrameRenderer a(own);
  FrameRenderer b(copies);
  EXPECT_NE(a.render(5), b.render(5));
}

}  // namespace
}  // namespace loopd::sequence
