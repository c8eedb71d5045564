// Motion of particles and walls, shared by all solvers of water, under the restrictions of native/simd.h.

#ifndef SOFTGYM_MJ_FLUID_MOTION_H_
#define SOFTGYM_MJ_FLUID_MOTION_H_

#include <cmath>

#include "fluid/plugin/kernels.h"
#include "native/shapes.h"

namespace softgym_mj {

// [spacings] Largest margin of lists of neighbors beyond the interaction range, and margin of lists of particles near
// walls, unless that of neighbors is 0. Lists are rebuilt when a pair outside may have come into range.
constexpr float kListSkin = 0.45f;
constexpr float kWallSkin = 0.3f;
constexpr float kFar = 1e6f;  // [m] Position of the particle that pads lists.
// [spacings] Coincident particles do not repel each other: all but one are moved by this.
constexpr float kNudge = 0.01f;
// Particles are held within this of the origin [m].
constexpr double kFurthest = 1e4;
constexpr int kShare = 64;  // Numbers of particles are summed in shares of this size, each by one thread.

namespace {

// Sum of number(i) for 0 <= i < count.
template <class T, class F>
inline T SumInShares(int count, F number) {
  T sum = {};
  for (int first = 0; first < count; first += kShare) {
    T share = {};
    for (int i = first; i < first + kShare && i < count; ++i) share = share + number(i);
    sum = sum + share;
  }
  return sum;
}

// Grid cell of a coordinate in units of the cell width. NaN and numbers beyond the range of integers, whose cast is
// undefined, get an arbitrary cell.
template <class T>
inline int CellOf(T x) {
#ifdef __CUDACC__
  return static_cast<int>(std::floor(x));
#else
  const long nearest = std::lrint(x);  // One instruction, which `floor` is not on every processor.
  return static_cast<int>(static_cast<unsigned>(nearest) - (static_cast<T>(nearest) > x ? 1u : 0u));
#endif
}

// Half extents of a shape in its own frame; a plane has none.
inline void HalfExtents(Shape shape, const float* s, float out[3]) {
  switch (shape) {
    case Shape::kSphere:
      out[0] = out[1] = out[2] = s[0];
      break;
    case Shape::kCapsule:
      out[0] = out[1] = s[0];
      out[2] = s[0] + s[1];
      break;
    case Shape::kCylinder:
      out[0] = out[1] = s[0];
      out[2] = s[1];
      break;
    default:
      out[0] = s[0];
      out[1] = s[1];
      out[2] = s[2];
  }
}

// Largest distance along an axis between a wall, other than a plane, and a particle near it [m].
inline float ReachAlong(const float* pose, const float half[3], int axis, float range) {
  const float* r = pose + 3 + 3 * axis;
  return std::fabs(r[0]) * half[0] + std::fabs(r[1]) * half[1] + std::fabs(r[2]) * half[2] + range;
}

// Lets a particle fall for a substep of h [s], `fall` by which it gets faster [m/s].
inline void Fall(const Particles& p, int i, const float fall[3], float max_speed, float h) {
  float *v = p.velocity + 4 * i, *x = p.position + 4 * i;
  for (int k = 0; k < 3; ++k) v[k] += fall[k];
  const float squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  const float slow = squared > max_speed * max_speed ? max_speed / std::sqrt(squared) : 1.0f;
  for (int k = 0; k < 3; ++k) {
    v[k] *= slow;
    x[k] += h * v[k];
  }
}

// Margin [m] of lists of neighbors that last, if possible, for the `later` substeps that follow. In a substep two
// particles approach each other by at most `approach` [m] at their velocities. Returns 0 if lists would not last for
// three substeps: new ones in every substep then cost less than longer ones.
inline float ListMargin(const FluidConstants& fluid, float approach, int later) {
  constexpr float kReserve = 1.5f, kLeast = 0.02f;  // For accelerations: factor, and margin at rest [spacings].
  const float most = kListSkin * fluid.spacing;
  if (later == 0 || 3 * approach > most) return 0;
  const float margin = kLeast * fluid.spacing + kReserve * approach * static_cast<float>(later);
  return margin < most ? margin : most;
}

// Squared length of at(k) - mean[k], 0 <= k < 3.
template <class F>
inline float SquaredDeviation(F at, const float* mean) {
  const float x = at(0) - mean[0], y = at(1) - mean[1], z = at(2) - mean[2];
  return x * x + y * y + z * z;
}

// Upper bound of the deviation of a wall point's displacement since pose `old` from `mean` [m].
inline float WallMotion(Shape shape, const float* size, const float* pose, const float* old, const float* mean) {
  float half[3], radius = kFar, turn = 0;
  if (shape != Shape::kPlane) {
    HalfExtents(shape, size, half);
    radius = std::sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]);
  }
  for (int k = 3; k < 12; ++k) turn += (pose[k] - old[k]) * (pose[k] - old[k]);
  return std::sqrt(SquaredDeviation([&](int k) { return pose[k] - old[k]; }, mean)) + radius * std::sqrt(turn);
}

// Linear and angular velocity of a wall that moves from pose a to pose b in h [s].
inline void WallVelocity(const float* a, const float* b, float h, float velocity[3], float omega[3]) {
  float turn[9];
  for (int k = 0; k < 3; ++k) velocity[k] = (b[k] - a[k]) / h;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      turn[3 * i + j] = 0;
      for (int k = 0; k < 3; ++k) {
        turn[3 * i + j] += (b[3 + 3 * i + k] - a[3 + 3 * i + k]) * b[3 + 3 * j + k];
      }
    }
  }
  omega[0] = (turn[7] - turn[5]) / (2 * h);
  omega[1] = (turn[2] - turn[6]) / (2 * h);
  omega[2] = (turn[3] - turn[1]) / (2 * h);
}

// Change of a particle's velocity by the water behind a moving wall at pose b; returns false if there is none. `share`:
// share of the wall.
inline bool DragAtWall(const Particles& p, int i, const float* b, const float velocity[3], const float omega[3],
                       float share, double change[3]) {
  share = share < 1.0f ? share : 1.0f;
  if (share == 0) return false;
  const float* x = p.position + 4 * i;
  const float r[3] = {x[0] - b[0], x[1] - b[1], x[2] - b[2]};
  const float wall[3] = {velocity[0] + omega[1] * r[2] - omega[2] * r[1],
                         velocity[1] + omega[2] * r[0] - omega[0] * r[2],
                         velocity[2] + omega[0] * r[1] - omega[1] * r[0]};
  for (int k = 0; k < 3; ++k) {
    change[k] = share * (wall[k] - p.velocity[4 * i + k]);
    p.velocity[4 * i + k] += static_cast<float>(change[k]);
  }
  return true;
}

// Random displacement in -1..1 along an axis for a coincident particle; `random` is the particle's state.
inline float NudgeAlong(unsigned* random) {
  *random = (*random ^ (*random >> 15)) * 2246822519u + 2654435769u;
  return static_cast<float>(*random >> 8) / 8388608.0f - 1.0f;
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_MOTION_H_
