#include "kernel_shapes.h"

#include <algorithm>
#include <cmath>

#include "native/vec.h"

namespace softgym_mj {
namespace {

// Neighbors are up to here [spacings]; they weigh 1 - (r / kNear)^2.
constexpr double kNear = 2.2;
// Variance [spacings^2] of where they are, along any direction, if they are all around.
constexpr double kVariance = kNear * kNear / 7;
// Reach [spacings] of a kernel that has neighbors all around, and of one that has none: the surface around a lone
// drop then has 0.6 spacings, hence the volume of a particle, nearly.
constexpr double kReach = 2.0;
constexpr double kDropReach = 1.32;
// The share of the way to the middle of its neighbors that the centre of a kernel is moved: flattens the surface, and
// draws it in to where walls hold particles back.
constexpr double kMoved = 0.5;
constexpr double kLeastReach = 1.95;  // [voxels] The surface around a lone drop must have a point of the grid inside.
constexpr size_t kMostInCell = 64;    // Of the particles in one place that count as neighbors; at rest there are 11.

unsigned long long Key(long long x, long long y, long long z) {
  constexpr unsigned long long kMask = (1u << 21) - 1;
  return (x & kMask) << 42 | (y & kMask) << 21 | (z & kMask);
}

double Square(double a) { return a * a; }

// How far q is from p for a metric, squared.
double Distance(const double metric[6], const Vector& d) {
  return metric[0] * d.x * d.x + metric[1] * d.y * d.y + metric[2] * d.z * d.z +
         2 * (metric[3] * d.y * d.z + metric[4] * d.x * d.z + metric[5] * d.x * d.y);
}

// The ellipsoid of a particle, given the offsets of those around it.
KernelShape FitKernel(const Vector& centre, const std::vector<Vector>& offsets, double spacing) {
  const double scale = 1 / Square(kNear * spacing);
  double sum = 1;  // Of the weights, with its own.
  Vector mean = {0, 0, 0};
  double square[6] = {0, 0, 0, 0, 0, 0};
  for (const Vector& d : offsets) {
    const double weight = 1 - scale * Dot(d, d);
    sum += weight;
    mean = mean + weight * d;
    const double products[6] = {d.x * d.x, d.y * d.y, d.z * d.z, d.y * d.z, d.x * d.z, d.x * d.y};
    for (int k = 0; k < 6; ++k) square[k] += weight * products[k];
  }
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
  const Vector moved = centre + kMoved * mean;
  KernelShape shape = {{moved.x, moved.y, moved.z}, {}, {}, 1};
  for (int k = 0; k < 6; ++k) shape.metric[k] = minors[k] / determinant;
  for (int k = 0; k < 3; ++k) shape.reach[k] = std::sqrt(extent[k]);
  // So that the water weighs about one wherever particles are.
  double weight = 1;
  for (const Vector& d : offsets) {
    const double s = std::max(0.0, 1 - Distance(shape.metric, d));
    weight += s * s * s;
  }
  shape.amplitude = 1 / weight;
  return shape;
}

}  // namespace

const std::vector<KernelShape>& KernelShapes::Find(const std::vector<double>& centres, double spacing) {
  const double side = kNear * spacing;
  const int count = static_cast<int>(centres.size() / 3);
  const auto cell = [side](double x) { return static_cast<long long>(std::floor(x / side)); };
  cells_.clear();
  for (int i = 0; i < count; ++i) {
    const double* x = &centres[3 * i];
    cells_.emplace_back(Key(cell(x[0]), cell(x[1]), cell(x[2])), i);
  }
  std::sort(cells_.begin(), cells_.end());
  shapes_.resize(count);
  for (auto first = cells_.begin(), last = first; first != cells_.end(); first = last) {
    while (last != cells_.end() && last->first == first->first) ++last;
    const double* own = &centres[3 * first->second];
    near_.clear();
    for (int k = 0; k < 27; ++k) {
      const auto key = Key(cell(own[0]) + k % 3 - 1, cell(own[1]) + k / 3 % 3 - 1, cell(own[2]) + k / 9 - 1);
      auto entry = std::lower_bound(cells_.begin(), cells_.end(), std::make_pair(key, 0));
      for (size_t n = 0; n < kMostInCell && entry != cells_.end() && entry->first == key; ++n, ++entry) {
        near_.push_back(FromArray(&centres[3 * entry->second]));
      }
    }
    for (auto entry = first; entry != last; ++entry) {
      const Vector centre = FromArray(&centres[3 * entry->second]);
      offsets_.clear();
      for (const Vector& other : near_) {
        const Vector d = other - centre;
        const double squared = Dot(d, d);
        if (squared > 0 && squared < side * side) offsets_.push_back(d);
      }
      shapes_[entry->second] = FitKernel(centre, offsets_, spacing);
    }
  }
  return shapes_;
}

}  // namespace softgym_mj
