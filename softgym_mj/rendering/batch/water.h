// The surface of water in a picture: where kernels around its particles weigh half as much as inside, as in
// fluid/plugin/surface.cc. Rays look for it; there is no mesh.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_WATER_H_
#define SOFTGYM_MJ_RENDERING_BATCH_WATER_H_

#include "rendering/batch/scene.h"

namespace softgym_mj::pictures {
namespace {

constexpr float kUnit = 1.0f / (1 << 20);  // Of weights: sums of whole numbers are the same in any order.
constexpr double kMostCells = 1e6;         // As there.
constexpr float kCoarser = 1.4f;           // Growth of voxels until they lie in the memory.
constexpr int kMostTries = 12;
constexpr float kStep = 0.5f;  // [voxels] Along a ray.
constexpr int kHalvings = 8;   // Of the step in which it enters the water.

inline long long CellOf(double x, double side) { return static_cast<long long>(floor(x / side)); }
inline int BucketOf(long long x, long long y, long long z) {
  return static_cast<int>((x & 15) | (y & 15) << 4 | (z & 15) << 8);
}
inline bool IsNear(const double* x, double side) {
  for (int k = 0; k < 3; ++k) {
    if (!(fabs(x[k]) < kMostCells * side)) return false;
  }
  return true;
}

// Which of the blocks that are kept a block of voxels is; -1 where none is.
inline int BlockAt(int x, int y, int z) {
  x += kBlocksX / 2, y += kBlocksX / 2, z += kBlocksZ / 4;
  const bool within = x >= 0 && x < kBlocksX && y >= 0 && y < kBlocksX && z >= 0 && z < kBlocksZ;
  return within ? (z * kBlocksX + y) * kBlocksX + x : -1;
}

// Sorts particles, in voxels, into buckets of cells in which neighbors are, and finds their kernels.
inline void FindKernels(const Canvas& c) {
  const Scene& s = *c.scene;
  const double voxel = c.voxel, spacing = s.spacing / voxel, side = kNear * spacing;
  Each(kBuckets + 1, [&](int i) { c.bucket_starts[i] = 0; });
  Each(s.num_points, [&](int i) {
    const double* x = c.points + 3 * i;
    c.cells[i] = kNone;
    if (!IsNear(x, std::min(voxel, static_cast<double>(s.spacing)))) return;
    const long long at[3] = {CellOf(x[0] / voxel, side), CellOf(x[1] / voxel, side), CellOf(x[2] / voxel, side)};
    c.cells[i] = CellKey(at[0], at[1], at[2]);
    Add(&c.bucket_starts[BucketOf(at[0], at[1], at[2]) + 1], 1);
  });
  SumUp(c.bucket_starts, kBuckets + 1, c.partial);
  Each(kBuckets, [&](int i) { c.bucket_ends[i] = c.bucket_starts[i]; });
  Each(s.num_points, [&](int i) {
    if (c.cells[i] == kNone) return;
    const double* x = c.points + 3 * i;
    const int bucket = BucketOf(CellOf(x[0] / voxel, side), CellOf(x[1] / voxel, side), CellOf(x[2] / voxel, side));
    c.in_buckets[Add(&c.bucket_ends[bucket], 1)] = i;
  });
  Each(kBuckets, [&](int i) {
    int *first = c.in_buckets + c.bucket_starts[i], *end = c.in_buckets + c.bucket_ends[i];
    for (int* p = first; p < end; ++p) {
      const int own = *p;
      int* to = p;
      for (; to > first && to[-1] > own; --to) *to = to[-1];
      *to = own;
    }
  });
  Each(s.num_points, [&](int i) {
    if (c.cells[i] == kNone) return;
    const double* x = c.points + 3 * i;
    const Vector centre = {x[0] / voxel, x[1] / voxel, x[2] / voxel};
    const long long at[3] = {CellOf(centre.x, side), CellOf(centre.y, side), CellOf(centre.z, side)};
    c.kernels[i] = FitKernel(centre, spacing, [&](const auto& f) {
      for (int k = 0; k < 27; ++k) {
        const long long cell[3] = {at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1};
        const unsigned long long key = CellKey(cell[0], cell[1], cell[2]);
        const int bucket = BucketOf(cell[0], cell[1], cell[2]);
        for (int n = c.bucket_starts[bucket], found = 0; n < c.bucket_ends[bucket] && found < kMostInCell; ++n) {
          const int other = c.in_buckets[n];
          if (c.cells[other] != key) continue;
          ++found;
          const double* y = c.points + 3 * other;
          const Vector d = Vector{y[0] / voxel, y[1] / voxel, y[2] / voxel} - centre;
          const double squared = Dot(d, d);
          if (squared > 0 && squared < side * side) f(d);
        }
      }
    });
  });
}

// Calls f(x, y, z) for the points of the grid that a kernel may reach, and those around them.
struct Reach {
  int low[3], high[3];

  explicit Reach(const KernelShape& kernel) {
    for (int k = 0; k < 3; ++k) {
      low[k] = static_cast<int>(floor(kernel.centre[k] - kernel.reach[k])) - 1;
      high[k] = static_cast<int>(ceil(kernel.centre[k] + kernel.reach[k])) + 1;
    }
  }
};

// Numbers the blocks in which there is water; whether they lie in the memory.
inline bool FindBlocks(const Canvas& c) {
  const Scene& s = *c.scene;
  Each(kBlocks, [&](int i) { c.blocks[i] = 0; });
  Each(s.num_points, [&](int i) {
    if (c.cells[i] == kNone) return;
    const Reach reach(c.kernels[i]);
    for (int z = reach.low[2] >> 3; z <= reach.high[2] >> 3; ++z) {
      for (int y = reach.low[1] >> 3; y <= reach.high[1] >> 3; ++y) {
        for (int x = reach.low[0] >> 3; x <= reach.high[0] >> 3; ++x) {
          const int block = BlockAt(x, y, z);
          if (block >= 0) SetBits(&c.blocks[block], 1);
        }
      }
    }
  });
  SumUp(c.blocks, kBlocks, c.partial);
  const bool fits = c.blocks[kBlocks - 1] <= kMostBlocks;
  Wait();
  Each(fits ? kBlocks : 0, [&](int i) {
    const int before = i > 0 ? c.blocks[i - 1] : 0;
    if (c.blocks[i] > before) c.wet[before] = i;
  });
  return fits;
}

inline void Weigh(const Canvas& c) {
  const Scene& s = *c.scene;
  Each(c.blocks[kBlocks - 1] * kVoxels, [&](int i) { c.weights[i] = 0; });
  Each(s.num_points, [&](int i) {
    if (c.cells[i] == kNone) return;
    const KernelShape& kernel = c.kernels[i];
    const Reach reach(kernel);
    for (int z = reach.low[2]; z <= reach.high[2]; ++z) {
      for (int y = reach.low[1]; y <= reach.high[1]; ++y) {
        for (int x = reach.low[0]; x <= reach.high[0]; ++x) {
          const Vector d = {x - kernel.centre[0], y - kernel.centre[1], z - kernel.centre[2]};
          const float left = static_cast<float>(1 - Distance(kernel.metric, d));
          if (left <= 0) continue;
          const int block = BlockAt(x >> 3, y >> 3, z >> 3);
          if (block < 0) continue;
          const float weight = static_cast<float>(kernel.amplitude) * left * left * left;
          const int at = (c.blocks[block] - 1) * kVoxels + ((x & 7) | (y & 7) << 3 | (z & 7) << 6);
          Add(&c.weights[at], static_cast<int>(weight / kUnit + 0.5f));
        }
      }
    }
  });
}

// The number of a block that has water, from 0 on, or -1.
inline int WetBlock(const Canvas& c, int x, int y, int z) {
  const int block = BlockAt(x, y, z);
  if (block < 0) return -1;
  const int before = block > 0 ? c.blocks[block - 1] : 0;
  return c.blocks[block] > before ? before : -1;
}

inline float WeightAt(const Canvas& c, int x, int y, int z) {
  const int block = WetBlock(c, x >> 3, y >> 3, z >> 3);
  return block < 0 ? 0
                   : kUnit * static_cast<float>(c.weights[block * kVoxels + ((x & 7) | (y & 7) << 3 | (z & 7) << 6)]);
}

// Whether the surface, made of triangles, would have no more than it may: as of a closed one, two for each side of a
// voxel that goes into the water.
inline bool IsFewEnough(const Canvas& c) {
  Once([&] { c.partial[0] = 0; });
  Each(c.blocks[kBlocks - 1] * kVoxels, [&](int i) {
    const int block = c.wet[i / kVoxels], k = i % kVoxels;
    const int x = 8 * (block % kBlocksX - kBlocksX / 2) + (k & 7),
              y = 8 * (block / kBlocksX % kBlocksX - kBlocksX / 2) + (k >> 3 & 7),
              z = 8 * (block / kBlocksX / kBlocksX - kBlocksZ / 4) + (k >> 6);
    const bool inside = kUnit * static_cast<float>(c.weights[i]) > kLevel;
    const int count = ((WeightAt(c, x + 1, y, z) > kLevel) != inside) +
                      ((WeightAt(c, x, y + 1, z) > kLevel) != inside) + ((WeightAt(c, x, y, z + 1) > kLevel) != inside);
    if (count) Add(&c.partial[0], count);
  });
  const bool found = 2 * c.partial[0] <= c.scene->most_triangles;
  Wait();
  return found;
}

inline void PlaceWater(Canvas* c) {
  for (int i = 0; i < kMostTries; ++i) {
    FindKernels(*c);
    if (FindBlocks(*c)) {
      Weigh(*c);
      if (IsFewEnough(*c)) return;
    }
    Once([&] { c->voxel *= kCoarser; });
  }
  Each(kBlocks, [&](int i) { c->blocks[i] = 0; });
}

// Between the points of the grid, in voxels.
inline float WeightAt(const Canvas& c, const Point& p) {
  const float fx = floorf(p.x), fy = floorf(p.y), fz = floorf(p.z);
  const int x = static_cast<int>(fx), y = static_cast<int>(fy), z = static_cast<int>(fz);
  const float u = p.x - fx, v = p.y - fy, w = p.z - fz;
  float sum = 0;
  for (int k = 0; k < 8; ++k) {
    const float a = k & 1 ? u : 1 - u, b = k & 2 ? v : 1 - v, d = k & 4 ? w : 1 - w;
    sum += a * b * d * WeightAt(c, x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
  }
  return sum;
}

// Where a ray from `start` enters the water, in (near, far) [lengths of `along`]; `far` if nowhere.
inline float EnterWater(const Canvas& c, const Point& start, const Point& along, float near, float far) {
  const float nowhere = far;
  const float scale = 1 / c.voxel;
  const Point from = scale * start, step = scale * along;
  // Within the box that may have water.
  const float low[3] = {-8.0f * kBlocksX / 2, -8.0f * kBlocksX / 2, -8.0f * kBlocksZ / 4};
  const float high[3] = {8.0f * kBlocksX / 2, 8.0f * kBlocksX / 2, 8.0f * kBlocksZ * 3 / 4};
  const float at[3] = {from.x, from.y, from.z}, by[3] = {step.x, step.y, step.z};
  for (int k = 0; k < 3; ++k) {
    if (by[k] == 0) {
      if (at[k] < low[k] || at[k] > high[k]) return nowhere;
      continue;
    }
    const float a = (low[k] - at[k]) / by[k], b = (high[k] - at[k]) / by[k];
    near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
  }
  const float stride = kStep / sqrtf(Dot(step, step));
  float outside = near;
  for (float t = near; t < far;) {
    const Point p = from + t * step;
    const int x = static_cast<int>(floorf(p.x)) >> 3, y = static_cast<int>(floorf(p.y)) >> 3,
              z = static_cast<int>(floorf(p.z)) >> 3;
    if (WetBlock(c, x, y, z) < 0) {  // On to the next block.
      const float corner[3] = {8.0f * static_cast<float>(x + (by[0] > 0)), 8.0f * static_cast<float>(y + (by[1] > 0)),
                               8.0f * static_cast<float>(z + (by[2] > 0))};
      float leave = far;
      for (int k = 0; k < 3; ++k) {
        if (by[k] != 0) leave = std::min(leave, (corner[k] - at[k]) / by[k]);
      }
      outside = t;
      t = std::max(leave, t) + 0.02f * stride;
      continue;
    }
    if (WeightAt(c, p) > kLevel) {
      float inside = t;
      for (int k = 0; k < kHalvings; ++k) {
        const float middle = 0.5f * (outside + inside);
        (WeightAt(c, from + middle * step) > kLevel ? inside : outside) = middle;
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

#endif  // SOFTGYM_MJ_RENDERING_BATCH_WATER_H_
