// How each particle fills space: an ellipsoid as its neighbors lie.

#ifndef SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_
#define SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_

#include <utility>
#include <vector>

#include "native/vec.h"

namespace softgym_mj {

// Weighs amplitude (1 - q)^3 where q = (x - centre) metric (x - centre) < 1, lengths in voxels.
struct KernelShape {
  double centre[3];
  double metric[6];  // xx, yy, zz, yz, xz, xy.
  double reach[3];   // Half the extents along the axes.
  double amplitude;
};

// Anisotropic kernels (Yu and Turk, 2013): wide along sheets and threads, narrow across them.
class KernelShapes {
 public:
  // Of particles at `centres` (x y z each, finite, in voxels); `spacing` in voxels, too.
  const std::vector<KernelShape>& Find(const std::vector<double>& centres, double spacing);

 private:
  std::vector<std::pair<unsigned long long, int>> cells_;  // Keys, sorted, with their particles.
  std::vector<Vector> near_;                               // Particles in and around a cell.
  std::vector<Vector> offsets_;                            // To the neighbors of one.
  std::vector<KernelShape> shapes_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_
