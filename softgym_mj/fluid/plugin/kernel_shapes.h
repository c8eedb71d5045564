// Anisotropic kernels of particles.

#ifndef SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_
#define SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_

#include <utility>
#include <vector>

#include "native/kernel_shape.h"

namespace softgym_mj {

class KernelShapes {
 public:
  // Returns the kernels of particles at `centers` (x y z each, finite) [voxels]; `spacing` [voxels].
  const std::vector<KernelShape>& Find(const std::vector<double>& centers, double spacing);

 private:
  std::vector<std::pair<unsigned long long, int>> cells_;  // Keys, sorted, with their particles.
  std::vector<Vector> near_;                               // Particles in and around a cell.
  std::vector<Vector> offsets_;                            // Vectors to the neighbors of a particle.
  std::vector<KernelShape> shapes_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNEL_SHAPES_H_
