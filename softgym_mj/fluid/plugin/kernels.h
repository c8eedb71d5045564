// Inner loops of the solver: one source, compiled for AVX2 and portably, with bit-identical results.
//
// Translation units that include kernels_impl.h are compiled for different processors, so they must
// not instantiate anything that another unit could share: no standard containers or algorithms.

#ifndef SOFTGYM_MJ_FLUID_KERNELS_H_
#define SOFTGYM_MJ_FLUID_KERNELS_H_

#include "native/shapes.h"

namespace softgym_mj {

// Constants of a fluid.
struct FluidConstants {
  float spacing;       // Rest distance d [m].
  float radius;        // Support H of the kernel [m].
  float rest_density;  // Sum of (1 - r/H)^3 over the neighbors in water at rest.
  float wall_density;  // Scale of a wall's contribution to that sum.
  float relaxation;    // Relaxation factor of the Jacobi iteration of a substep.
  float correction;    // Largest correction in a substep [m].
  float contact;       // Distance at which walls are hard [m].
  float cohesion;      // Largest displacement of a pair by cohesion in a substep [m].
  float friction;      // Coulomb coefficient at walls.
};

// Particles in sorted order. Arrays of 4 floats per particle (x, y, z, 0); `count` real particles and a distant one,
// which pads lists.
struct Particles {
  int count;
  float* position;       // Predicted, then corrected [m].
  float* old_position;   // At the start of the substep [m].
  float* velocity;       // [m/s].
  float* correction;     // Displacement of the substep [m].
  float* gradient;       // Sum of e_ij, plus the walls' part (see kernels_impl.h).
  float* wall_gradient;  // The walls' part.
  float* wall_density;   // Density added by walls, one float per particle.
  float* free_share;     // Product over the walls of the share that they leave open, one float per particle.
  float* pressure;       // One float per particle.
  float* packed;         // Position (x, y, z) and pressure, in batches, which do not keep e_ij.
  bool* crowded;         // Set if two particles may be in one place.
  const float* x;        // Coordinates at the time the lists were built.
  const float* y;
  const float* z;
};

// A wrapped grid of cells, each as wide as the search distance; sizes are powers of two, 4 or more.
struct Grid {
  int nx, ny, nz;
  const int* start;  // First particle of each cell, nx * ny * nz + 1 entries.
};

// Scratch memory: copies of particles in and around cells, with room for all and two vectors more.
struct Candidates {
  float *x, *y, *z;
  int* index;
};

// Index of a particle in a list; on a GPU, where lists of all environments do not fit into the caches, of 16 bits.
#ifdef __CUDACC__
using ListIndex = unsigned short;
#else
using ListIndex = int;
#endif

// Neighbors of particle i are index[begin[i]] .. index[end[i]], padded to whole vectors.
struct Neighbors {
  int* begin;
  const int* end;
  ListIndex* index;
  long capacity;   // Capacity of `index`.
  int most;        // Largest number per particle; further neighbors are left out.
  bool* too_many;  // Set if one has more.
  float* e;        // Three arrays of `stride` floats: e_ij by component.
  long stride;
  Candidates candidates;
};

// Particles near one wall, padded, and intermediate results of the kernels.
struct WallPairs {
  int count;  // Whole vectors.
  Shape shape;
  const float* size;   // (3,)
  const float* start;  // Pose at the start of the substep: position (3,), rotation matrix (9,).
  const float* end;    // The same at its end.
  const int* particle;
  float* normal;  // Three arrays of `stride` floats.
  float* share;   // Share of the kernel filled by the wall, 0..1.
  float* slope;   // Its decrease with distance, times H / 3 and the rest density.
  long stride;
};

struct Kernels {
  // Fills the lists with all neighbors within `distance`; false if they exceed the capacity.
  bool (*FindNeighbors)(const Particles&, const Grid&, float distance, const Neighbors&);
  // Computes pressures, and writes displacements by cohesion into `correction`.
  void (*FindPressure)(const FluidConstants&, const Particles&, const Neighbors&);
  // Adds displacements by pressure to `correction`.
  void (*AddCorrection)(const FluidConstants&, const Particles&, const Neighbors&);
  // Writes the change of velocity by viscosity (a factor of the weighted differences to the neighbors) into
  // `correction`.
  void (*Smooth)(const FluidConstants&, const Particles&, const Neighbors&, float viscosity);
  // Lists the particles within `range` of a wall at its end pose, padded; returns the length of the list. `list` must
  // have room for all and a vector more.
  int (*FindNear)(const Particles&, const WallPairs&, float range, int* list);
  // Distance [m] of particles to a wall at its end pose.
  void (*FindDistance)(const WallPairs&, const float* position, float* distance);
  void (*FindWallShare)(const FluidConstants&, const Particles&, const WallPairs&);
  void (*AddWallGradient)(const Particles&, const WallPairs&);
  // Keeps particles out of a wall. With `impulse` (6 numbers: sum of displacements and of their
  // moments about the world origin), adds the reaction on the wall.
  void (*Collide)(const FluidConstants&, const Particles&, const WallPairs&, double* impulse);
};

extern const Kernels kPortableKernels;
#ifdef SOFTGYM_MJ_X86
extern const Kernels kAvx2Kernels;
#endif

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNELS_H_
