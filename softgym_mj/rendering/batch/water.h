// Water of the batch renderer: kernel weights of particles on a grid, as in fluid/plugin/surface.cc.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_WATER_H_
#define SOFTGYM_MJ_RENDERING_BATCH_WATER_H_

#include "rendering/batch/scene.h"

namespace softgym_mj::pictures {
namespace {

constexpr float kUnit = 1.0f / (1 << 20);  // Unit of weights: integer sums do not depend on the order.
constexpr double kMostCells = 1e6;         // The same number as in surface.cc.
constexpr float kCoarser = 1.4f;           // Growth of voxels until they fit into the memory.
constexpr int kMostTries = 48;             // After this many growths, voxels are as large as the rendered space.

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

// Index of the stored block at block coordinates; -1 if none is stored.
inline int BlockAt(int x, int y, int z) {
  x += kBlocksX / 2, y += kBlocksX / 2, z += kBlocksZ / 4;
  const bool within = x >= 0 && x < kBlocksX && y >= 0 && y < kBlocksX && z >= 0 && z < kBlocksZ;
  return within ? (z * kBlocksX + y) * kBlocksX + x : -1;
}

// Coordinates of a stored block: the inverse of BlockAt.
inline void PlaceOfBlock(int block, int at[3]) {
  at[0] = block % kBlocksX - kBlocksX / 2, at[1] = block / kBlocksX % kBlocksX - kBlocksX / 2,
  at[2] = block / kBlocksX / kBlocksX - kBlocksZ / 4;
}

// Sorts particles into hash buckets of cells, and computes their kernels.
inline void FindKernels(const Canvas& c) {
  const Scene& s = *c.scene;
  const double voxel = c.voxel, spacing = s.spacing / voxel, side = kNear * spacing;
  const auto bucket_of = [&](const double* x) {
    if (!IsNear(x, std::min(voxel, static_cast<double>(s.spacing)))) return -1;
    return BucketOf(CellOf(x[0] / voxel, side), CellOf(x[1] / voxel, side), CellOf(x[2] / voxel, side));
  };
  Each(kBuckets + 1, [&](int i) { c.bucket_starts[i] = 0; });
  Each(s.num_points, [&](int i) {
    const int bucket = bucket_of(c.points + 3 * i);
    if (bucket >= 0) Add(&c.bucket_starts[bucket + 1], 1);
  });
  SumUp(c.bucket_starts, kBuckets + 1, c.partial);
  Each(kBuckets, [&](int i) { c.bucket_ends[i] = c.bucket_starts[i]; });
  Each(s.num_points, [&](int i) {
    const int bucket = bucket_of(c.points + 3 * i);
    if (bucket >= 0) c.in_buckets[Add(&c.bucket_ends[bucket], 1)] = i;
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
  const int count = c.bucket_starts[kBuckets];
  Each(count, [&](int i) {
    const double* x = c.points + 3 * c.in_buckets[i];
    const Vector center = {x[0] / voxel, x[1] / voxel, x[2] / voxel};
    c.centers[i] = center;
    c.cells[i] = CellKey(CellOf(center.x, side), CellOf(center.y, side), CellOf(center.z, side));
  });
  Each(count, [&](int i) {
    const Vector center = c.centers[i];
    const long long at[3] = {CellOf(center.x, side), CellOf(center.y, side), CellOf(center.z, side)};
    c.kernels[i] = FitKernel(center, spacing, [&](const auto& f) {
      for (int k = 0; k < 27; ++k) {
        const long long cell[3] = {at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1};
        const unsigned long long key = CellKey(cell[0], cell[1], cell[2]);
        const int bucket = BucketOf(cell[0], cell[1], cell[2]);
        for (int n = c.bucket_starts[bucket], found = 0; n < c.bucket_starts[bucket + 1] && found < kMostInCell; ++n) {
          if (c.cells[n] != key) continue;
          ++found;
          const Vector d = c.centers[n] - center;
          const double squared = Dot(d, d);
          if (squared > 0 && squared < side * side) f(d);
        }
      }
    });
  });
}

// Range of grid points within a kernel, with a margin of `around` points.
struct Reach {
  int low[3], high[3];

  Reach(const KernelShape& kernel, int around) {
    for (int k = 0; k < 3; ++k) {
      low[k] = static_cast<int>(floor(kernel.center[k] - kernel.reach[k])) - around;
      high[k] = static_cast<int>(ceil(kernel.center[k] + kernel.reach[k])) + around;
    }
  }
};

// Numbers the blocks with water; returns whether they fit into the memory.
inline bool FindBlocks(const Canvas& c, int growths) {
  Each(kBlocks, [&](int i) { c.blocks[i] = 0; });
  Each(c.bucket_starts[kBuckets], [&](int i) {
    if (IsLeftOut(c.kernels[i], c.in_buckets[i], growths)) return;
    const Reach reach(c.kernels[i], 1);
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
  const int count = c.blocks[kBlocks - 1];
  Wait();
  if (count > kMostBlocks) return false;
  Each(kBlocks, [&](int i) {
    const int before = i > 0 ? c.blocks[i - 1] : 0;
    if (c.blocks[i] > before) c.wet[before] = i;
  });
  Each(kBlocks, [&](int i) { c.blocks[i] = -1; });
  Each(3, [&](int k) { c.low_block[k] = kBlocksX, c.high_block[k] = -kBlocksX; });
  Each(count, [&](int i) { c.blocks[c.wet[i]] = i; });
  Once([&] {
    c.wet[kMostBlocks] = count;
    for (int i = 0; i < count; ++i) {
      int at[3];
      PlaceOfBlock(c.wet[i], at);
      for (int k = 0; k < 3; ++k) {
        c.low_block[k] = std::min(c.low_block[k], at[k]), c.high_block[k] = std::max(c.high_block[k], at[k]);
      }
    }
  });
  return true;
}

inline int VoxelOf(int x, int y, int z) { return (x & 7) | (y & 7) << 3 | (z & 7) << 6; }

inline void Weigh(const Canvas& c, int growths) {
  Each(c.wet[kMostBlocks] * kVoxels, [&](int i) { c.weights[i] = 0; });
  Each(c.bucket_starts[kBuckets], [&](int i) {
    const KernelShape& kernel = c.kernels[i];
    if (IsLeftOut(kernel, c.in_buckets[i], growths)) return;
    const Reach reach(kernel, 0);
    float metric[6], center[3];
    for (int k = 0; k < 6; ++k) metric[k] = static_cast<float>(k < 3 ? kernel.metric[k] : 2 * kernel.metric[k]);
    for (int k = 0; k < 3; ++k) center[k] = static_cast<float>(kernel.center[k]);
    const float amplitude = static_cast<float>(kernel.amplitude) / kUnit;
    for (int z = reach.low[2]; z <= reach.high[2]; ++z) {
      for (int y = reach.low[1]; y <= reach.high[1]; ++y) {
        const float dy = static_cast<float>(y) - center[1], dz = static_cast<float>(z) - center[2];
        const float rest = 1 - metric[2] * dz * dz - dy * (metric[1] * dy + metric[3] * dz);
        const float slope = metric[4] * dz + metric[5] * dy;
        for (int x = reach.low[0]; x <= reach.high[0]; ++x) {
          const float dx = static_cast<float>(x) - center[0], left = rest - dx * (slope + metric[0] * dx);
          if (left <= 0) continue;
          const int at = BlockAt(x >> 3, y >> 3, z >> 3), block = at < 0 ? -1 : c.blocks[at];
          if (block < 0) continue;
          Add(&c.weights[block * kVoxels + VoxelOf(x, y, z)], static_cast<int>(amplitude * left * left * left + 0.5f));
        }
      }
    }
  });
}

// Index of a block with water, or -1.
inline int WetBlock(const Canvas& c, int x, int y, int z) {
  const int block = BlockAt(x, y, z);
  return block < 0 ? -1 : c.blocks[block];
}

inline float WeightAt(const Canvas& c, int x, int y, int z) {
  const int block = WetBlock(c, x >> 3, y >> 3, z >> 3);
  return block < 0 ? 0 : kUnit * static_cast<float>(c.weights[block * kVoxels + VoxelOf(x, y, z)]);
}

// Finds the cells that may contain water. Returns whether an equivalent closed mesh, with two triangles per voxel face
// at the surface, would stay within the limit.
inline bool FindCells(const Canvas& c) {
  const int count = c.wet[kMostBlocks];
  Once([&] { c.partial[0] = 0; });
  Each(count * (kVoxels / 32), [&](int i) { c.crossed[i] = 0; });
  Each(count, [&](int i) { c.num_crossed[i] = 0; });
  Each(count * kVoxels, [&](int i) {
    const int k = i % kVoxels;
    int at[3];
    PlaceOfBlock(c.wet[i / kVoxels], at);
    const int x = 8 * at[0] + (k & 7), y = 8 * at[1] + (k >> 3 & 7), z = 8 * at[2] + (k >> 6);
    bool any = false, inside[8];
    for (int n = 0; n < 8; ++n) {
      inside[n] = WeightAt(c, x + (n & 1), y + (n >> 1 & 1), z + (n >> 2)) > kLevel;
      any = any || inside[n];
    }
    if (!any) return;
    SetBits(&c.crossed[i / 32], static_cast<int>(1u << i % 32));
    Add(&c.num_crossed[i / kVoxels], 1);
    const int sides = (inside[1] != inside[0]) + (inside[2] != inside[0]) + (inside[4] != inside[0]);
    if (sides) Add(&c.partial[0], sides);
  });
  const bool found = 2 * c.partial[0] <= c.scene->most_triangles;
  Wait();
  return found;
}

inline void PlaceWater(Canvas* c) {
  for (int i = 0; i < kMostTries; ++i) {
    FindKernels(*c);
    if (FindBlocks(*c, i)) {
      Weigh(*c, i);
      if (FindCells(*c)) return;
    }
    Once([&] { c->voxel *= kCoarser; });
  }
  Each(kBlocks, [&](int i) { c->blocks[i] = -1; });
  Each(3, [&](int k) { c->low_block[k] = 0, c->high_block[k] = -1; });
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_WATER_H_
