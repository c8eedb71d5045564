#include "surface.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace softgym_mj {
namespace {

// Particles weigh (1 - (r/R)^2)^3 up to R = kReach spacings. The surface is kRadius spacings from
// their weighted mean. Where they weigh 1.2 to 0.7 together this grows to kDropRadius (in voxels on a
// grid wider than the spacing), so that even a lone drop contains a point of the grid.
constexpr double kReach = 2.0;
constexpr double kRadius = 0.6;
constexpr double kDropRadius = 0.95;
// What is further from the world's origin than this many cells, or not a number, is not drawn: a key has
// 21 bits for each axis.
constexpr double kMostCells = 1e6;
// Of 8 KB: as many as 200000 particles fill, finely, that lie together. Scattered drops would take eight each.
constexpr size_t kMostBlocks = 1 << 15;

uint64_t Key(int x, int y, int z) {
  constexpr uint64_t kMask = (1u << 21) - 1;
  return (x & kMask) << 42 | (y & kMask) << 21 | (z & kMask);
}

}  // namespace

SurfaceExtractor::Block& SurfaceExtractor::FindBlock(int x, int y, int z) {
  auto [entry, added] = index_.try_emplace(Key(x, y, z), static_cast<int>(blocks_.size()));
  if (added) {
    blocks_.emplace_back();
    Block& block = blocks_.back();
    block.x = x;
    block.y = y;
    block.z = z;
    std::memset(block.sums, 0, sizeof(block.sums));
  }
  return blocks_[entry->second];
}

void SurfaceExtractor::Splat(const double position[3], double radius, double voxel) {
  int low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    low[k] = static_cast<int>(std::ceil((position[k] - radius) / voxel));
    high[k] = static_cast<int>(std::floor((position[k] + radius) / voxel));
  }
  const float scale = static_cast<float>(voxel * voxel / (radius * radius));
  const auto offset = [&](int i, int k) { return static_cast<float>(i - position[k] / voxel); };
  const auto down = [](int i) { return i >> 3; };  // Division by kBlock, rounded down.
  for (int bz = down(low[2]); bz <= down(high[2]); ++bz) {
    for (int by = down(low[1]); by <= down(high[1]); ++by) {
      for (int bx = down(low[0]); bx <= down(high[0]); ++bx) {
        float (*sums)[4] = FindBlock(bx, by, bz).sums;
        const int base[3] = {bx * kBlock, by * kBlock, bz * kBlock};
        for (int z = std::max(low[2], base[2]); z <= std::min(high[2], base[2] + kBlock - 1); ++z) {
          const float dz = offset(z, 2);
          for (int y = std::max(low[1], base[1]); y <= std::min(high[1], base[1] + kBlock - 1); ++y) {
            const float dy = offset(y, 1), yz = dy * dy + dz * dz;
            float (*row)[4] = sums + kBlock * ((y - base[1]) + kBlock * (z - base[2])) - base[0];
            for (int x = std::max(low[0], base[0]); x <= std::min(high[0], base[0] + kBlock - 1); ++x) {
              const float dx = offset(x, 0);
              const float s = std::max(0.0f, 1.0f - scale * (dx * dx + yz));
              const float weight = s * s * s;
              row[x][0] += weight;
              row[x][1] += weight * dx;
              row[x][2] += weight * dy;
              row[x][3] += weight * dz;
            }
          }
        }
      }
    }
  }
}

// Makes the faces across the grid edges that begin in a block.
void SurfaceExtractor::Mesh(const Block& block, float radius, float drop_radius, double voxel) {
  // How deep the points of the block, and one around it, are in the water, in voxels.
  constexpr int kSide = kBlock + 2;
  float values[kSide * kSide * kSide];
  bool inside = false, outside = false;
  for (int bz = -1; bz <= 1; ++bz) {
    for (int by = -1; by <= 1; ++by) {
      for (int bx = -1; bx <= 1; ++bx) {
        auto entry = index_.find(Key(block.x + bx, block.y + by, block.z + bz));
        const float (*sums)[4] = entry == index_.end() ? nullptr : blocks_[entry->second].sums;
        const auto range = [](int b, int* first, int* last) {
          *first = b < 0 ? -1 : b * kBlock;
          *last = b < 0 ? -1 : b == 0 ? kBlock - 1 : kBlock;
        };
        int x0, x1, y0, y1, z0, z1;
        range(bx, &x0, &x1);
        range(by, &y0, &y1);
        range(bz, &z0, &z1);
        for (int z = z0; z <= z1; ++z) {
          for (int y = y0; y <= y1; ++y) {
            for (int x = x0; x <= x1; ++x) {
              constexpr int kMask = kBlock - 1;
              float v = -radius;
              if (sums) {
                const float* p = sums[(x & kMask) + kBlock * ((y & kMask) + kBlock * (z & kMask))];
                const float offset = std::sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
                if (p[0] > 0) {
                  const float alone = std::min(1.0f, std::max(0.0f, 2.0f * (1.2f - p[0])));
                  v = radius + alone * (drop_radius - radius) - offset / p[0];
                }
              }
              values[(x + 1) + kSide * ((y + 1) + kSide * (z + 1))] = v;
              (v > 0 ? inside : outside) = true;
            }
          }
        }
      }
    }
  }
  if (!inside || !outside) return;
  const float* centre = values + 1 + kSide * (1 + kSide);
  constexpr int kStep[3] = {1, kSide, kSide * kSide};
  const double base[3] = {block.x * kBlock * voxel, block.y * kBlock * voxel, block.z * kBlock * voxel};
  // The vertex of a cell: the mean of where its edges cross the surface.
  const auto vertex = [&](int x, int y, int z, float out[3]) {
    const float* v = centre + x + kStep[1] * y + kStep[2] * z;
    float sum[3] = {0, 0, 0};
    int crossings = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int b = (axis + 1) % 3, c = (axis + 2) % 3;
      for (int corner = 0; corner < 4; ++corner) {
        const int cb = corner & 1, cc = corner >> 1;
        const float p = v[cb * kStep[b] + cc * kStep[c]];
        const float q = v[cb * kStep[b] + cc * kStep[c] + kStep[axis]];
        if ((p > 0) == (q > 0)) continue;
        sum[axis] += p / (p - q);
        sum[b] += static_cast<float>(cb);
        sum[c] += static_cast<float>(cc);
        ++crossings;
      }
    }
    const int cell[3] = {x, y, z};
    for (int k = 0; k < 3; ++k) {
      out[k] = static_cast<float>(base[k] + voxel * (cell[k] + sum[k] / crossings));
    }
  };
  for (int z = 0; z < kBlock; ++z) {
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBlock; ++x) {
        const float* v = centre + x + kStep[1] * y + kStep[2] * z;
        for (int axis = 0; axis < 3; ++axis) {
          const bool from = v[0] > 0, to = v[kStep[axis]] > 0;
          if (from == to) continue;
          // The four cells around the edge, anticlockwise about it.
          const int b = (axis + 1) % 3, c = (axis + 2) % 3;
          float corners[4][3];
          constexpr int kTurn[4][2] = {{0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
          for (int k = 0; k < 4; ++k) {
            int cell[3] = {x, y, z};
            cell[b] += kTurn[k][0];
            cell[c] += kTurn[k][1];
            vertex(cell[0], cell[1], cell[2], corners[from ? k : 3 - k]);
          }
          for (int k : {0, 1, 2, 0, 2, 3}) {
            triangles_.insert(triangles_.end(), corners[k], corners[k] + 3);
          }
        }
      }
    }
  }
}

const Triangles* SurfaceExtractor::Extract(const double* positions, int count, double spacing, double voxel, int most) {
  index_.clear();
  blocks_.clear();
  triangles_.clear();
  for (int i = 0; i < count; ++i) {
    const double* x = positions + 3 * i;
    const auto has_cell = [voxel](double a) { return std::fabs(a) < kMostCells * voxel; };
    if (has_cell(x[0]) && has_cell(x[1]) && has_cell(x[2])) Splat(x, kReach * spacing, voxel);
    if (blocks_.size() > kMostBlocks) return nullptr;
  }
  const float radius = static_cast<float>(kRadius * spacing / voxel);
  const float drop_radius = static_cast<float>(kDropRadius * std::max(spacing / voxel, 1.0));
  for (const Block& block : blocks_) {
    Mesh(block, radius, drop_radius, voxel);
    if (triangles_.size() / 9 > static_cast<size_t>(most)) return nullptr;
  }
  return &triangles_;
}

}  // namespace softgym_mj
