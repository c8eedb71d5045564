// CPU kernels: loops over single particles or groups of eight, under the restrictions of kernels.h.

#ifndef SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
#define SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_

#include "fluid/plugin/lists.h"
#include "fluid/plugin/particles.h"
#include "fluid/plugin/pressures.h"
#include "fluid/plugin/pushes.h"

namespace softgym_mj {
namespace {

void SmoothAll(const FluidConstants& constants, const Particles& particles, const Neighbors& lists, float viscosity) {
  const FluidConstants fluid = constants;
  const Particles p = particles;
  const Neighbors neighbors = lists;
  for (int i = 0; i < p.count; ++i) Smooth(fluid, p, neighbors, viscosity, i);
}

void FindDistances(const WallPairs& pairs, const float* position, float* distance) {
  for (int k = 0; k < pairs.count; k += kLanes) FindDistance(pairs, position, distance, k);
}

void FindWallShares(const FluidConstants& constants, const Particles& p, const WallPairs& pairs) {
  const FluidConstants fluid = constants;
  for (int k = 0; k < pairs.count; k += kLanes) FindWallShare(fluid, p, pairs, k);
}

void AddWallGradients(const Particles& p, const WallPairs& pairs) {
  for (int k = 0; k < pairs.count; ++k) AddWallGradient(p, pairs, k);
}

void CollideAll(const FluidConstants& constants, const Particles& p, const WallPairs& pairs, double* impulse) {
  const FluidConstants fluid = constants;
  for (int k = 0; impulse && k < pairs.count; k += kLanes) {
    Collide(fluid, p, pairs, k, [&](const Vec3<Lanes>& change, const Vec3<Lanes>& to, Lanes push) {
      EachPush(pairs, p.count, k, change, to, push, [impulse](int, const double terms[6]) {
        for (int t = 0; t < 6; ++t) impulse[t] -= terms[t];
      });
    });
  }
  for (int k = 0; !impulse && k < pairs.count; k += kLanes) {
    Collide(fluid, p, pairs, k, [](const Vec3<Lanes>&, const Vec3<Lanes>&, Lanes) {});
  }
}

constexpr Kernels kLoops = {FindNeighbors, FindPressure,   AddCorrections,   SmoothAll, FindNear,
                            FindDistances, FindWallShares, AddWallGradients, CollideAll};

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
