// Anisotropic kernel of a particle for the water surface: an ellipsoid that follows the distribution of its neighbors.

#ifndef SOFTGYM_MJ_NATIVE_KERNEL_SHAPE_H_
#define SOFTGYM_MJ_NATIVE_KERNEL_SHAPE_H_

#include <algorithm>
#include <cmath>

#include "native/vec.h"

namespace softgym_mj {

// Kernel amplitude (1 - q)^3 with q = (x - center) metric (x - center) < 1, lengths in voxels.
struct KernelShape {
  double center[3];
  double metric[6];  // xx, yy, zz, yz, xz, xy.
  double reach[3];   // Half the extents along the axes.
  double amplitude;
  int neighbors;
};

namespace {

// [spacings] Largest distance of neighbors, whose weight is 1 - (r / kNear)^2.
constexpr double kNear = 2.2;
// Variance [spacings^2] of their positions along any direction if they are isotropic.
constexpr double kVariance = kNear * kNear / 7;
// Reach [spacings] of a kernel that has neighbors all around, and of one that has none: the surface around a lone
// drop then has 0.6 spacings, hence the volume of a particle, nearly.
constexpr double kReach = 2.0;
constexpr double kDropReach = 1.32;
// Share of the way to the mean of its neighbors by which the center of a kernel is moved: it flattens the surface and
// draws it in at walls.
constexpr double kMoved = 0.5;
constexpr double kLeastReach = 1.95;  // [voxels] The surface of a lone drop must contain a grid point.
constexpr int kMostInCell = 64;       // Largest number of neighbors per cell; at rest there are 11.
// Particles with fewer neighbors are drops. If a surface has too many triangles, voxels and drops grow. The number of
// triangles of a drop is constant, so each growth leaves out half of the remaining drops. Voxels grow by about the
// square root of two, which preserves the total area of drops in an image.
constexpr int kLeastNeighbors = 4;
constexpr int kMostHalvings = 24;
constexpr float kLevel = 0.5f;  // Weight of the water at its surface: about one inside, zero outside.

// Key of a cell less than a million cells away from the origin.
inline unsigned long long CellKey(long long x, long long y, long long z) {
  constexpr unsigned long long kMask = (1u << 21) - 1;
  return (x & kMask) << 42 | (y & kMask) << 21 | (z & kMask);
}

inline double Square(double a) { return a * a; }

// Whether a particle is left out after a number of growths of the voxels.
inline bool IsLeftOut(const KernelShape& kernel, int particle, int growths) {
  const int halvings = std::min(growths, kMostHalvings);
  return kernel.neighbors < kLeastNeighbors && particle % (1 << halvings) != 0;
}

// Squared length of d in a metric.
inline double Distance(const double metric[6], const Vector& d) {
  return metric[0] * d.x * d.x + metric[1] * d.y * d.y + metric[2] * d.z * d.z +
         2 * (metric[3] * d.y * d.z + metric[4] * d.x * d.z + metric[5] * d.x * d.y);
}

// The ellipsoid of a particle (Yu and Turk, 2013): wide along sheets and threads, narrow across them. `offsets(f)`
// calls f with the offset of each particle around it, in the same order each time.
template <class Offsets>
inline KernelShape FitKernel(const Vector& center, double spacing, const Offsets& offsets) {
  const double scale = 1 / Square(kNear * spacing);
  double sum = 1;  // Sum of the weights including its own.
  Vector mean = {0, 0, 0};
  int neighbors = 0;
  double square[6] = {0, 0, 0, 0, 0, 0};
  offsets([&](const Vector& d) {
    const double weight = 1 - scale * Dot(d, d);
    sum += weight;
    ++neighbors;
    mean = mean + weight * d;
    const double products[6] = {d.x * d.x, d.y * d.y, d.z * d.z, d.y * d.z, d.x * d.z, d.x * d.y};
    for (int k = 0; k < 6; ++k) square[k] += weight * products[k];
  });
  mean = (1 / sum) * mean;
  const double means[6] = {mean.x * mean.x, mean.y * mean.y, mean.z * mean.z,
                           mean.y * mean.z, mean.x * mean.z, mean.x * mean.y};
  const double drop = Square(std::max(kDropReach * spacing, kLeastReach));
  const double grown = std::max(0.0, Square(kReach * spacing) - drop) / (kVariance * spacing * spacing);
  double extent[6];  // The ellipsoid is x extent^-1 x < 1.
  for (int k = 0; k < 6; ++k) extent[k] = grown * (square[k] / sum - means[k]) + (k < 3 ? drop : 0);
  const double xx = extent[0], yy = extent[1], zz = extent[2], yz = extent[3], xz = extent[4], xy = extent[5];
  const double minors[6] = {yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy,
                            xy * xz - xx * yz, xy * yz - yy * xz, xz * yz - zz * xy};
  const double determinant = xx * minors[0] + xy * minors[5] + xz * minors[4];
  const Vector moved = center + kMoved * mean;
  KernelShape shape = {{moved.x, moved.y, moved.z}, {}, {}, 1, neighbors};
  for (int k = 0; k < 6; ++k) shape.metric[k] = minors[k] / determinant;
  for (int k = 0; k < 3; ++k) shape.reach[k] = std::sqrt(extent[k]);
  // Normalization, so that the weight inside water is about one.
  double weight = 1;
  offsets([&](const Vector& d) {
    const double s = std::max(0.0, 1 - Distance(shape.metric, d));
    weight += s * s * s;
  });
  shape.amplitude = 1 / weight;
  return shape;
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_KERNEL_SHAPE_H_
