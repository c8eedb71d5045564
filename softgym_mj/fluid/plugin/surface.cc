#include "surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "cubes.h"
#include "native/export.h"
#include "native/reset.h"

namespace softgym_mj {
namespace {

// Particles further from the world's origin than this many cells, or with NaN, are not drawn: a key has 21 bits per
// axis.
constexpr double kMostCells = 1e6;
// Limit of blocks of 8 KB: 200,000 connected particles fill as many at a fine resolution. Scattered drops take eight
// each.
constexpr size_t kMostBlocks = 1 << 15;
constexpr double kCoarser = 1.4;  // Growth of the voxels until the surface fits.
// After this many growths, voxels are as large as the space in which particles are drawn.
constexpr int kMostTries = 48;
// Taubin (1995): passes of smoothing, each followed by one that undoes the loss of volume; of some vertices of a drop
// it does not. Less one, as many as voxels in this many spacings.
constexpr double kSmoothed = 2;
constexpr double kShrink = 0.5, kGrow = -0.53;

// Location of a point of a block or of the first points beyond it: the adjacent block as bits, and the index in it.
int NearOf(int x, int y, int z) { return (x >> 3) | (y >> 3) << 1 | (z >> 3) << 2; }
int PointOf(int x, int y, int z) { return (x & 7) | (y & 7) << 3 | (z & 7) << 6; }

}  // namespace

SurfaceExtractor::Block& SurfaceExtractor::FindBlock(int x, int y, int z) {
  auto [entry, added] = index_.try_emplace(CellKey(x, y, z), static_cast<int>(blocks_.size()));
  if (added) {
    blocks_.emplace_back();
    Block& block = blocks_.back();
    block.x = x;
    block.y = y;
    block.z = z;
    std::memset(block.weight, 0, sizeof(block.weight));
  }
  return blocks_[entry->second];
}

void SurfaceExtractor::Splat(const KernelShape& kernel) {
  int low[3], high[3];  // Bounds with a margin of one point, so that blocks have all edges that the surface crosses.
  for (int k = 0; k < 3; ++k) {
    low[k] = static_cast<int>(std::floor(kernel.center[k] - kernel.reach[k])) - 1;
    high[k] = static_cast<int>(std::ceil(kernel.center[k] + kernel.reach[k])) + 1;
  }
  float metric[6];
  for (int k = 0; k < 6; ++k) metric[k] = static_cast<float>(k < 3 ? kernel.metric[k] : 2 * kernel.metric[k]);
  const auto [xx, yy, zz, yz, xz, xy] = metric;
  const float amplitude = static_cast<float>(kernel.amplitude), most = 0.25f / xx;
  const auto down = [](int i) { return i >> 3; };  // Division by kBlock, rounded down.
  for (int bz = down(low[2]); bz <= down(high[2]); ++bz) {
    for (int by = down(low[1]); by <= down(high[1]); ++by) {
      for (int bx = down(low[0]); bx <= down(high[0]); ++bx) {
        float* weight = FindBlock(bx, by, bz).weight;
        const int base[3] = {bx * kBlock, by * kBlock, bz * kBlock};
        float offset[3];  // Offset of the block's first point.
        for (int k = 0; k < 3; ++k) offset[k] = static_cast<float>(base[k] - kernel.center[k]);
        const int y0 = std::max(low[1] - base[1], 0), y1 = std::min(high[1] - base[1], kBlock - 1);
        const int z0 = std::max(low[2] - base[2], 0), z1 = std::min(high[2] - base[2], kBlock - 1);
        for (int z = z0; z <= z1; ++z) {
          const float dz = offset[2] + static_cast<float>(z);
          for (int y = y0; y <= y1; ++y) {
            const float dy = offset[1] + static_cast<float>(y);
            // Along the row 1 - q is a parabola.
            const float rest = 1 - zz * dz * dz - dy * (yy * dy + yz * dz), slope = xz * dz + xy * dy;
            if (rest + most * slope * slope <= 0) continue;
            // A whole row, which the compiler vectorizes.
            float* row = weight + PointOf(0, y, z);
            for (int x = 0; x < kBlock; ++x) {
              const float dx = offset[0] + static_cast<float>(x), s = rest - dx * (slope + xx * dx);
              const float positive = s > 0 ? s : 0;
              row[x] += amplitude * (positive * positive * positive);
            }
          }
        }
      }
    }
  }
}

void SurfaceExtractor::LookAround(const Block& block, Surroundings* around) const {
  for (int k = 0; k < 8; ++k) {
    auto entry = index_.find(CellKey(block.x + (k & 1), block.y + (k >> 1 & 1), block.z + (k >> 2)));
    around->near[k] = entry == index_.end() ? nullptr : &blocks_[entry->second];
  }
  int count = 0;
  for (int z = 0; z < kSide; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const Block* near = around->near[NearOf(x, y, z)];
        count += around->inside[z][y][x] = near && near->weight[PointOf(x, y, z)] > kLevel;
      }
    }
  }
  around->crossed = 0 < count && count < kSide * kSide * kSide;
}

// Places vertices [voxels] on the edges that begin in a block.
void SurfaceExtractor::PlaceVertices(Block* block) {
  Surroundings around;
  LookAround(*block, &around);
  if (!around.crossed) return;
  for (int z = 0; z < kBlock; ++z) {
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBlock; ++x) {
        for (int axis = 0; axis < 3; ++axis) {
          const int to[3] = {x + (axis == 0), y + (axis == 1), z + (axis == 2)};
          if (around.inside[z][y][x] == around.inside[to[2]][to[1]][to[0]]) continue;
          const int point = PointOf(x, y, z);
          const Block* near = around.near[NearOf(to[0], to[1], to[2])];
          const float from = block->weight[point],
                      step = (near ? near->weight[PointOf(to[0], to[1], to[2])] : 0) - from;
          float at[3] = {static_cast<float>(block->x * kBlock + x), static_cast<float>(block->y * kBlock + y),
                         static_cast<float>(block->z * kBlock + z)};
          at[axis] += (kLevel - from) / step;
          block->crossing[point][axis] = static_cast<int>(mesh_.vertices.size());
          mesh_.vertices.push_back({at[0], at[1], at[2]});
        }
      }
    }
  }
}

void SurfaceExtractor::PlaceFaces(const Block& block) {
  Surroundings around;
  LookAround(block, &around);
  if (!around.crossed) return;
  const auto& cubes = CubeTriangles();
  for (int z = 0; z < kBlock; ++z) {
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBlock; ++x) {
        int inside = 0;
        for (int k = 0; k < 8; ++k) inside |= around.inside[z + (k >> 2)][y + (k >> 1 & 1)][x + (k & 1)] << k;
        for (const int edge : cubes[inside]) {
          const CubeEdge e = EdgeOfCube(edge);
          const int from[3] = {x + (e.corner & 1), y + (e.corner >> 1 & 1), z + (e.corner >> 2)};
          const Block* near = around.near[NearOf(from[0], from[1], from[2])];
          mesh_.faces.push_back(near->crossing[PointOf(from[0], from[1], from[2])][e.axis]);
        }
      }
    }
  }
}

// Moves vertices by a share of the way to the mean of their neighbors.
void SurfaceExtractor::Smooth(double share) {
  sums_.assign(mesh_.vertices.size(), {0, 0, 0});
  counts_.assign(mesh_.vertices.size(), 0);
  for (size_t i = 0; i < mesh_.faces.size(); i += 3) {
    for (int k = 0; k < 3; ++k) {  // Each side is once in this order, in one of its two triangles.
      const int from = mesh_.faces[i + k], to = mesh_.faces[i + (k + 1) % 3];
      sums_[from] = sums_[from] + mesh_.vertices[to];
      ++counts_[from];
    }
  }
  for (size_t i = 0; i < sums_.size(); ++i) {
    const float s = static_cast<float>(share);
    mesh_.vertices[i] = (1 - s) * mesh_.vertices[i] + s / counts_[i] * sums_[i];
  }
}

void SurfaceExtractor::FindNormals() {
  std::vector<Vec3<float>>& normals = mesh_.normals;
  normals.assign(mesh_.vertices.size(), {0, 0, 0});
  for (size_t i = 0; i < mesh_.faces.size(); i += 3) {
    const int* face = &mesh_.faces[i];
    const Vec3<float> first = mesh_.vertices[face[0]];
    const Vec3<float> area = Cross(mesh_.vertices[face[1]] - first, mesh_.vertices[face[2]] - first);
    for (int k = 0; k < 3; ++k) normals[face[k]] = normals[face[k]] + area;
  }
  for (Vec3<float>& n : normals) {
    const float length = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
    n = length > 0 ? 1 / length * n : Vec3<float>{0, 0, 1};
  }
}

// Extracts the surface [voxels] after `growths` growths; returns false if it does not fit.
bool SurfaceExtractor::TryVoxel(const double* positions, int count, double spacing, double voxel, size_t most,
                                int growths) {
  index_.clear();
  blocks_.clear();
  centers_.clear();
  particles_.clear();
  mesh_.vertices.clear();
  mesh_.faces.clear();
  for (int i = 0; i < count; ++i) {
    const double* x = positions + 3 * i;
    const auto has_cell = [&](double a) { return std::fabs(a) < kMostCells * std::min(voxel, spacing); };
    if (!has_cell(x[0]) || !has_cell(x[1]) || !has_cell(x[2])) continue;
    for (int k = 0; k < 3; ++k) centers_.push_back(x[k] / voxel);
    particles_.push_back(i);
  }
  const std::vector<KernelShape>& kernels = kernels_.Find(centers_, spacing / voxel);
  for (size_t i = 0; i < kernels.size(); ++i) {
    if (IsLeftOut(kernels[i], particles_[i], growths)) continue;
    Splat(kernels[i]);
    if (blocks_.size() > kMostBlocks) return false;
  }
  for (Block& block : blocks_) {
    PlaceVertices(&block);
    if (mesh_.vertices.size() > most) return false;
  }
  for (const Block& block : blocks_) {
    PlaceFaces(block);
    if (mesh_.faces.size() / 3 > most) return false;
  }
  return true;
}

const SurfaceMesh* SurfaceExtractor::Extract(const double* positions, int count, double spacing, double voxel, int most,
                                             double offset) {
  int tries = 0;
  while (!TryVoxel(positions, count, spacing, voxel, most, tries)) {
    if (++tries == kMostTries) return nullptr;
    voxel *= kCoarser;
  }
  for (int pass = 1; pass < kSmoothed * spacing / voxel; ++pass) {
    Smooth(kShrink);
    Smooth(kGrow);
  }
  FindNormals();
  for (size_t i = 0; i < mesh_.vertices.size(); ++i) {
    mesh_.vertices[i] = static_cast<float>(voxel) * mesh_.vertices[i] + static_cast<float>(offset) * mesh_.normals[i];
  }
  return &mesh_;
}

}  // namespace softgym_mj

// Copies the surface around particles (`SurfaceExtractor`). There is room for `most` triangles and as many vertices,
// because a closed mesh has fewer. `sizes`: numbers of vertices and faces. Returns 0, 1 if there is not enough room, or
// 2 if memory runs out.
SGM_EXPORT int softgym_mj_water_mesh(const double* positions, int count, double spacing, double voxel, int most,
                                     double offset, float* vertices, float* normals, int* faces, int* sizes) {
  using namespace softgym_mj;
  const SurfaceMesh* mesh = nullptr;
  const bool tried = WithinMemory([&] {
    thread_local SurfaceExtractor extractor;
    mesh = extractor.Extract(positions, count, spacing, voxel, most, offset);
  });
  if (!mesh) return tried ? 1 : 2;
  sizes[0] = static_cast<int>(mesh->vertices.size());
  sizes[1] = static_cast<int>(mesh->faces.size() / 3);
  std::memcpy(vertices, mesh->vertices.data(), sizeof(float) * 3 * sizes[0]);
  std::memcpy(normals, mesh->normals.data(), sizeof(float) * 3 * sizes[0]);
  std::memcpy(faces, mesh->faces.data(), sizeof(int) * mesh->faces.size());
  return 0;
}
