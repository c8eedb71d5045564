// Displacement of walls in a step; walls beyond the limit count as teleported.

#ifndef SOFTGYM_MJ_FLUID_SWEEP_H_
#define SOFTGYM_MJ_FLUID_SWEEP_H_

#include <algorithm>
#include <cmath>

#include "fluid/plugin/kernels.h"
#include "native/rotation.h"

namespace softgym_mj {
namespace {

// Shortest rotation between two quaternions: axis times angle.
inline void TurnBetween(const double a[4], const double b[4], double turn[3]) {
  const double back[4] = {a[0], -a[1], -a[2], -a[3]};
  double q[4];
  MulQuat(b, back, q);
  const double sine = std::sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double half = asin(sine < 1 ? sine : 1.0), sign = q[0] < 0 ? -1 : 1;
  for (int k = 0; k < 3; ++k) turn[k] = sine > 0 ? sign * 2 * half / sine * q[1 + k] : 0;
}

inline double Length(const double a[3]) { return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }

// Path length in a step of a point at `offset` from the center of a wall that moves by `way` and rotates by `turn`.
inline double WayOfPoint(const double way[3], const double turn[3], const double offset[3]) {
  const double moved[3] = {way[0] + turn[1] * offset[2] - turn[2] * offset[1],
                           way[1] + turn[2] * offset[0] - turn[0] * offset[2],
                           way[2] + turn[0] * offset[1] - turn[1] * offset[0]};
  return Length(moved);
}

// Path length [m] of the fastest point of a wall between poses a and b (position and quaternion): of a corner of a box,
// of an end of a capsule's axis; an upper bound for other shapes. Rotations that leave a shape unchanged, and all
// rotations of planes, do not count.
inline double WayOfWall(Shape shape, const float size[3], const double a[7], const double b[7]) {
  double way[3], turn[3];
  for (int k = 0; k < 3; ++k) way[k] = b[k] - a[k];
  TurnBetween(a + 3, b + 3, turn);
  const double length = Length(way);
  double half[3] = {0, 0, 0}, round = 0;  // Corners, and radius around them.
  switch (shape) {
    case Shape::kBox:
      for (int k = 0; k < 3; ++k) half[k] = size[k];
      break;
    case Shape::kCapsule:
      half[2] = size[1];
      break;
    case Shape::kCylinder:
      half[2] = size[1], round = size[0];
      break;
    case Shape::kEllipsoid:
      return length + Length(turn) * std::max(std::max(size[0], size[1]), size[2]);
    default:
      return length;
  }
  // At half the rotation, points move in the direction of their displacement from a to b.
  double middle[4], dot = 0, furthest = 0;
  for (int k = 3; k < 7; ++k) dot += a[k] * b[k];
  for (int k = 0; k < 4; ++k) middle[k] = a[3 + k] + (dot < 0 ? -b[3 + k] : b[3 + k]);
  Normalize4(middle);
  for (int corner = 0; corner < 8; ++corner) {
    double local[3], offset[3];
    for (int k = 0; k < 3; ++k) local[k] = corner >> k & 1 ? half[k] : -half[k];
    RotVecQuat(local, middle, offset);
    furthest = std::max(furthest, WayOfPoint(way, turn, offset));
  }
  if (round == 0) return furthest;
  // Discs: the component of the rotation perpendicular to the axis tilts them.
  const double up[3] = {0, 0, 1};
  double axis[3];
  RotVecQuat(up, middle, axis);
  const double along = turn[0] * axis[0] + turn[1] * axis[1] + turn[2] * axis[2];
  const double square = turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] - along * along;
  return furthest + round * std::sqrt(square > 0 ? square : 0.0);
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_SWEEP_H_
