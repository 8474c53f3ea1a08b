#include "make_sequence/geometry.h"

#include <cmath>

namespace loopd::sequence {

Pose make_pose(Vec3 position, double heading_rad, double pitch_rad, double roll_rad) {
  const Vec3 ahead{std::cos(heading_rad), std::sin(heading_rad), 0};
  const Vec3 level_right{ahead.y, -ahead.x, 0};
  const Vec3 up{0, 0, 1};
  const Vec3 forward = std::cos(pitch_rad) * ahead + std::sin(pitch_rad) * up;
  const Vec3 level_down = std::sin(pitch_rad) * ahead - std::cos(pitch_rad) * up;
  const double c = std::cos(roll_rad);
  const double s = std::sin(roll_rad);
  return {position, c * level_right + s * level_down, c * level_down - s * level_right, forward};
}

std::array<double, 4> quaternion_xyzw(const Pose& pose) {
  const Vec3& a = pose.right;
  const Vec3& b = pose.down;
  const Vec3& c = pose.forward;
  // Four times the square of each component; divide by the largest (Shepperd).
  const double w = 1 + a.x + b.y + c.z;
  const double x = 1 + a.x - b.y - c.z;
  const double y = 1 - a.x + b.y - c.z;
  const double z = 1 - a.x - b.y + c.z;
  std::array<double, 4> q{};
  if (w >= x && w >= y && w >= z) {
    q = {b.z - c.y, c.x - a.z, a.y - b.x, w};
  } else if (x >= y && x >= z) {
    q = {x, b.x + a.y, c.x + a.z, b.z - c.y};
  } else if (y >= z) {
    q = {b.x + a.y, y, c.y + b.z, c.x - a.z};
  } else {
    q = {c.x + a.z, c.y + b.z, z, a.y - b.x};
  }
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double sign = q[3] < 0 ? -1 : 1;
  for (double& component : q) component *= sign / norm;
  return q;
}

}  // namespace loopd::sequence
