// Water surface by ray marching: the isosurface at half of the inner weight, without a mesh.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_SURFACE_H_
#define SOFTGYM_MJ_RENDERING_BATCH_SURFACE_H_

#include "rendering/batch/water.h"

namespace softgym_mj::pictures {
namespace {

constexpr float kStep = 0.5f;      // [voxels] Step along a ray.
constexpr float kEndless = 1e30f;  // Replaces 1 / 0.
constexpr int kSecants = 3;        // Secant iterations to the surface.

// Trilinear interpolation of the weight at a point [voxels].
inline float WeightAt(const Canvas& c, const Point& p) {
  const float fx = floorf(p.x), fy = floorf(p.y), fz = floorf(p.z);
  const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
  const float u = p.x - fx, v = p.y - fy, w = p.z - fz;
  float corner[8];
  if ((x & 7) < 7 && (y & 7) < 7 && (z & 7) < 7) {  // All corners are in one block.
    const int block = WetBlock(c, x >> 3, y >> 3, z >> 3);
    if (block < 0) return 0;
    const int* own = c.weights + block * kVoxels + VoxelOf(x, y, z);
    for (int k = 0; k < 8; ++k) {
      corner[k] = kUnit * static_cast<float>(own[(k & 1) | (k >> 1 & 1) << 3 | (k >> 2) << 6]);
    }
  } else {
    for (int k = 0; k < 8; ++k) corner[k] = WeightAt(c, x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
  }
  const auto between = [](float a, float b, float share) { return a + share * (b - a); };
  const float low = between(between(corner[0], corner[1], u), between(corner[2], corner[3], u), v);
  const float high = between(between(corner[4], corner[5], u), between(corner[6], corner[7], u), v);
  return between(low, high, w);
}

// Distance in (near, far) [lengths of `along`] at which a ray from `start` enters the water; `far` if it does not.
// `comes_near`: set if a cell on its path contains water.
inline float EnterWater(const Canvas& c, const Point& start, const Point& along, float near, float far,
                        bool* comes_near = nullptr) {
  const float nowhere = far;
  const float scale = 1 / c.voxel;
  const Point from = scale * start, step = scale * along;
  // Clips the ray to the bounding box of water.
  float low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    low[k] = 8.0f * static_cast<float>(c.low_block[k]);
    high[k] = 8.0f * static_cast<float>(c.high_block[k] + 1);
  }
  const float at[3] = {from.x, from.y, from.z}, by[3] = {step.x, step.y, step.z};
  float scales[3];
  for (int k = 0; k < 3; ++k) {
    scales[k] = by[k] != 0 ? 1 / by[k] : kEndless;
    const float a = (low[k] - at[k]) * scales[k], b = (high[k] - at[k]) * scales[k];
    near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
  }
  // Distance at which the ray leaves a cube of the grid.
  const auto leave = [&](const int* cube, float side) {
    float t = far;
    for (int k = 0; k < 3; ++k) {
      t = std::min(t, (side * static_cast<float>(cube[k] + (by[k] > 0)) - at[k]) * scales[k]);
    }
    return t;
  };
  const float stride = kStep / sqrtf(Dot(step, step)), little = 0.02f * stride;
  float outside = near;
  for (float t = near; t < far;) {
    const Point p = from + t * step;
    const int cell[3] = {static_cast<int>(floorf(p.x)), static_cast<int>(floorf(p.y)), static_cast<int>(floorf(p.z))};
    const int cube[3] = {cell[0] >> 3, cell[1] >> 3, cell[2] >> 3};
    const int block = WetBlock(c, cube[0], cube[1], cube[2]);
    if (block < 0 || c.num_crossed[block] == 0) {
      outside = t, t = std::max(leave(cube, 8), t) + little;
      continue;
    }
    const int i = block * kVoxels + VoxelOf(cell[0], cell[1], cell[2]);
    if (!(static_cast<unsigned>(c.crossed[i / 32]) >> i % 32 & 1)) {
      outside = t, t = std::max(leave(cell, 1), t) + little;
      continue;
    }
    if (comes_near) *comes_near = true;
    float inside = t, within = WeightAt(c, p);
    if (within > kLevel) {
      float without = WeightAt(c, from + outside * step);
      for (int k = 0; k < kSecants && without <= kLevel; ++k) {
        const float middle = outside + (kLevel - without) / (within - without) * (inside - outside);
        const float weight = WeightAt(c, from + middle * step);
        if (weight > kLevel) {
          inside = middle, within = weight;
        } else {
          outside = middle, without = weight;
        }
      }
      return inside;
    }
    outside = t;
    t += stride;
  }
  return nowhere;
}

inline Point WaterNormal(const Canvas& c, const Point& place) {
  constexpr float kAside = 0.5f;  // [voxels]
  const Point p = 1 / c.voxel * place, x = {kAside, 0, 0}, y = {0, kAside, 0}, z = {0, 0, kAside};
  return Direction({WeightAt(c, p - x) - WeightAt(c, p + x), WeightAt(c, p - y) - WeightAt(c, p + y),
                    WeightAt(c, p - z) - WeightAt(c, p + z)});
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_SURFACE_H_
