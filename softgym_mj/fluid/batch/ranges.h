// Particles in and around a cell of the grid.

#ifndef SOFTGYM_MJ_FLUID_BATCH_RANGES_H_
#define SOFTGYM_MJ_FLUID_BATCH_RANGES_H_

#include "fluid/plugin/kernels.h"

namespace softgym_mj::fluid {
namespace {

constexpr int kRanges = 18;  // Largest number of ranges of particles in the cells around one.

// Fills the nonempty ranges of particles in and around a cell; returns their number. They are 9 rows of cells, each one
// range or, where it wraps, two.
inline int FindRanges(const Grid& grid, int cx, int cy, int cz, int* first, int* last) {
  const int* start = grid.start;
  const int nx = grid.nx, ny = grid.ny, nz = grid.nz;
  int ranges = 0;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      const int row = nx * (((cy + dy) & (ny - 1)) + ny * ((cz + dz) & (nz - 1)));
      if (cx > 0 && cx < nx - 1) {
        first[ranges] = start[row + cx - 1];
        last[ranges] = start[row + cx + 2];
        ranges += first[ranges] < last[ranges];
      } else {
        const int left = cx > 0 ? cx - 1 : 0, right = cx > 0 ? nx : 2;
        first[ranges] = start[row + left];
        last[ranges] = start[row + right];
        ranges += first[ranges] < last[ranges];
        const int other = cx > 0 ? 0 : nx - 1;
        first[ranges] = start[row + other];
        last[ranges] = start[row + other + 1];
        ranges += first[ranges] < last[ranges];
      }
    }
  }
  return ranges;
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_RANGES_H_
