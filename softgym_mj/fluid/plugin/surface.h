// The water's surface as a triangle mesh.

#ifndef SOFTGYM_MJ_FLUID_SURFACE_H_
#define SOFTGYM_MJ_FLUID_SURFACE_H_

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "kernel_shapes.h"
#include "native/vec.h"

namespace softgym_mj {

// A closed mesh: each side of a triangle is shared with exactly one other.
struct SurfaceMesh {
  std::vector<Vec3<float>> vertices;  // [m]
  std::vector<Vec3<float>> normals;   // Unit, out of the water.
  std::vector<int> faces;             // Three vertices each, counterclockwise seen from outside.
};

// Marching cubes (Lorensen and Cline, 1987) around anisotropic kernels, smoothed, on a sparse grid.
class SurfaceExtractor {
 public:
  // Returns the surface around `count` particles (x y z each) with rest distance `spacing` [m] and about one vertex per
  // `voxel` [m]. If there are more than `most` triangles, voxels grow and some single drops are left out. `offset` [m]
  // moves the surface outwards. The result is valid until the next call; null if it does not fit or takes too much
  // memory.
  const SurfaceMesh* Extract(const double* positions, int count, double spacing, double voxel, int most,
                             double offset = 0);

 private:
  static constexpr int kBlock = 8;  // Grid points along the side of a block.
  static constexpr int kPoints = kBlock * kBlock * kBlock;
  struct Block {
    int x, y, z;
    float weight[kPoints];     // Weight of the water per grid point.
    int crossing[kPoints][3];  // Vertex on the edge to the next point along an axis, where the surface crosses it.
  };
  static constexpr int kSide = kBlock + 1;  // Including the first points of adjacent blocks.
  // A block with its adjacent ones.
  struct Surroundings {
    const Block* near[8];              // Null where there is no water.
    bool inside[kSide][kSide][kSide];  // By z, y, x.
    bool crossed;                      // Whether some are inside, some are not.
  };

  bool TryVoxel(const double* positions, int count, double spacing, double voxel, size_t most, int growths);
  Block& FindBlock(int x, int y, int z);
  void Splat(const KernelShape& kernel);
  void LookAround(const Block& block, Surroundings* around) const;
  void PlaceVertices(Block* block);
  void PlaceFaces(const Block& block);
  void Smooth(double share);
  void FindNormals();

  KernelShapes kernels_;
  std::vector<double> centers_;
  std::vector<int> particles_;  // Particle of each center.
  std::unordered_map<uint64_t, int> index_;
  std::vector<Block> blocks_;
  std::vector<Vec3<float>> sums_;
  std::vector<int> counts_;
  SurfaceMesh mesh_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_SURFACE_H_
