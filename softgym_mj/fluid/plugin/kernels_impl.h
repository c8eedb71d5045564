// CPU kernels: loops over single particles or groups of eight, under the restrictions of kernels.h.

#ifndef SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
#define SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_

#include "fluid/plugin/particles.h"

namespace softgym_mj {
namespace {

// Constants are copied: what follows from them alone leaves the loops, as nothing that is written can be them.
bool FindNeighbors(const Particles& particles, const Grid& grid, float distance, const Neighbors& out) {
  const Particles p = particles;
  const int* start = grid.start;
  const int nx = grid.nx, ny = grid.ny, nz = grid.nz, dummy = p.count;
  const Lanes limit(distance * distance);
  int* index = out.index;
  int length = 0;
  for (int cz = 0; cz < nz; ++cz) {
    for (int cy = 0; cy < ny; ++cy) {
      for (int cx = 0; cx < nx; ++cx) {
        const int cell = cx + nx * (cy + ny * cz);
        if (start[cell] == start[cell + 1]) continue;
        int first[kRanges], last[kRanges];
        const int ranges = FindRanges(grid, cx, cy, cz, first, last);
        long candidates = 0;
        for (int r = 0; r < ranges; ++r) candidates += last[r] - first[r];
        if (candidates > out.most) candidates = out.most;
        const long room = candidates + 3 * kLanes;  // More are written for a moment.
        if (length + room * (start[cell + 1] - start[cell]) > out.capacity) return false;
        for (int i = start[cell]; i < start[cell + 1]; ++i) {
          out.begin[i] = length;
          const int most = length + out.most;
          const Vec3<Lanes> x = {Lanes(p.x[i]), Lanes(p.y[i]), Lanes(p.z[i])};
          for (int r = 0; r < ranges; ++r) length = ListRange(p, i, x, limit, first[r], last[r], most, length, index);
          if (length > most) {
            length = most;
            *out.too_many = true;
          }
          while ((length - out.begin[i]) % kLanes) index[length++] = dummy;
        }
      }
    }
  }
  out.begin[p.count] = length;
  return true;
}

void FindPressure(const FluidConstants& constants, const Particles& particles, const Neighbors& lists) {
  const FluidConstants fluid = constants;
  const Particles p = particles;
  const Neighbors neighbors = lists;
  for (int i = 0; fluid.cohesion > 0 && i < p.count; ++i) FindPressureOf<true, true>(fluid, p, neighbors, i);
  for (int i = 0; !(fluid.cohesion > 0) && i < p.count; ++i) FindPressureOf<false, true>(fluid, p, neighbors, i);
}

void AddCorrections(const FluidConstants& constants, const Particles& particles, const Neighbors& lists) {
  const FluidConstants fluid = constants;
  const Particles p = particles;
  const Neighbors neighbors = lists;
  for (int i = 0; i < p.count; ++i) AddCorrection<true>(fluid, p, neighbors, i);
}

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
  for (int k = 0; k < pairs.count; k += kLanes) Collide(fluid, p, pairs, impulse, k);
}

constexpr Kernels kLoops = {FindNeighbors, FindPressure,   AddCorrections,   SmoothAll,
                            FindDistances, FindWallShares, AddWallGradients, CollideAll};

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
