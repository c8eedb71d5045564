// The water's surface as a triangle mesh.

#ifndef SOFTGYM_MJ_FLUID_SURFACE_H_
#define SOFTGYM_MJ_FLUID_SURFACE_H_

#include <cstdint>
#include <unordered_map>
#include <vector>

namespace softgym_mj {

// Nine coordinates a triangle, anticlockwise seen from outside.
using Triangles = std::vector<float>;

// Surface nets (Gibson, 1998) around the weighted mean of the particles (Zhu and Bridson, 2005): flat
// where water is still, a ball around a lone drop. The grid is sparse, so that far droplets cost
// nothing in between.
class SurfaceExtractor {
 public:
  // The surface around `count` particles (x y z each) `spacing` apart at rest, with a vertex about
  // every `voxel` metres. The result is valid until the next call; null if it would have more than `most` triangles or
  // take too much memory.
  const Triangles* Extract(const double* positions, int count, double spacing, double voxel, int most);

 private:
  static constexpr int kBlock = 8;  // Grid points along the side of a block.
  struct Block {
    int x, y, z;
    // Per grid point: sum of the weights of the particles around, and of their weighted offsets
    // from it, in voxels.
    float sums[kBlock * kBlock * kBlock][4];
  };

  Block& FindBlock(int x, int y, int z);
  void Splat(const double position[3], double radius, double voxel);
  void Mesh(const Block& block, float radius, float drop_radius, double voxel);

  std::unordered_map<uint64_t, int> index_;
  std::vector<Block> blocks_;
  Triangles triangles_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_SURFACE_H_
