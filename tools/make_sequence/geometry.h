#pragma once

#include <array>

namespace loopd::sequence {

/// World coordinates are metres, z up, floor at z = 0.
struct Vec3 {
  double x = 0;
  double y = 0;
  double z = 0;
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double s, Vec3 v) { return {s * v.x, s * v.y, s * v.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// A pinhole camera without distortion; pixel (0, 0) is the centre of the top-left pixel.
struct Camera {
  int width_px = 640;
  int height_px = 480;
  double focal_px = 400;
  double cx_px = 319.5;
  double cy_px = 239.5;
};

/// world_from_camera: where the camera is, and its axes in the world (x right, y down, z forward).
struct Pose {
  Vec3 position;
  Vec3 right;
  Vec3 down;
  Vec3 forward;
};

/// Heading counter-clockwise from world +x seen from above, pitch upwards, roll clockwise as the
/// camera sees the world turn counter-clockwise; radians.
Pose make_pose(Vec3 position, double heading_rad, double pitch_rad, double roll_rad);

/// The rotation of `pose` as a unit quaternion x, y, z, w with w >= 0.
std::array<double, 4> quaternion_xyzw(const Pose& pose);

}  // namespace loopd::sequence
