// Water of one environment of a batch: its state, the inputs of a step, and the memory of a step.

#ifndef SOFTGYM_MJ_FLUID_BATCH_ENVIRONMENT_H_
#define SOFTGYM_MJ_FLUID_BATCH_ENVIRONMENT_H_

#include "batch/group.h"
#include "batch/memory.h"
#include "fluid/batch/model.h"
#include "fluid/plugin/motion.h"

namespace softgym_mj::fluid {

// Largest number of listed neighbors of a particle; in water at rest there are at most 39.
constexpr int kMostNeighbors = 88;
constexpr int kListStride = kMostNeighbors + kLanes;  // Writes may exceed the list by one vector.
constexpr int kListRoom = 264;                        // Room behind the last list for the writes of `FindNeighbors`.

// Failures of a step as bits.
enum Flag { kNotFinite = 1, kTooManyNeighbors = 2, kTooManyCells = 4, kScattered = 8 };

// Scalars of a step.
struct Step {
  int flags, expired, repeated, nx, ny, nz;
  bool too_many, crowded;
  double origin[3], furthest[3], extent[3], sum[3];
  float margin;  // Margin of the lists [m]; 0 if they are not valid for another substep.
  float mean[3], first, second;
  int pairs[kMostWalls];
  float wall_start[12 * kMostWalls], wall_end[12 * kMostWalls], wall_built[12 * kMostWalls];
  double from[7 * kMostWalls], to[7 * kMostWalls];  // Poses at the start and the end of the step.
};

struct Environment {
  const Model* model;
  const double* poses;  // (bodies, 7) Positions [m] and quaternions of bodies at the end of the step.
  // State: whether `walls` (walls, 7), the poses at the end of the last step, are known; particles (count, 3) [m],
  // [m/s].
  double *known, *positions, *velocities, *walls;
  // With walls that the water pushes, else null: forces on each wall about the center of mass of its body (walls, 6)
  // [N], [N m], impulses that are still to act (walls, 6) [N s], [N m s]; and inverse inertias of bodies: the largest
  // mobility along an axis [1/kg] and about one [1/(kg m^2)] (bodies, 2).
  double *forces, *pending;
  const double* mobility;

  // Scratch memory.
  Step* step;
  Particles particles;
  float *spare, *built, *wall_numbers;
  double* sums;              // Partial sums (SumAll).
  double *terms, *impulses;  // Of pushed walls: terms of each pair (6,), and impulses in this step (6,).
  int *cell, *start, *order, *spare_order, *pair_particle, *fill, *partial;
  Neighbors neighbors;
  int *begin, *end;
};

inline void TakeMemory(const Model& model, Memory* memory, Environment* w) {
  const int n = model.count + kLanes;
  Particles* p = &w->particles;
  memory->Take(&w->step, 1);
  float** const of_four[] = {&p->position,      &p->old_position, &p->velocity, &p->correction, &p->gradient,
                             &p->wall_gradient, &p->packed,       &w->spare,    &w->built};
  for (float** a : of_four) memory->Take(a, 4 * n);
  float *x = nullptr, *y = nullptr, *z = nullptr;
  float** const of_one[] = {&p->wall_density, &p->free_share, &p->pressure, &x, &y, &z};
  for (float** a : of_one) memory->Take(a, n);
  p->x = x, p->y = y, p->z = z;
  p->count = model.count;
  p->crowded = w->step ? &w->step->crowded : nullptr;
  int** const of_indices[] = {&w->cell, &w->order, &w->spare_order, &w->begin, &w->end};
  for (int** a : of_indices) memory->Take(a, n);
  memory->Take(&w->start, model.most_cells + 2);
  memory->Take(&w->fill, model.most_cells + 2);
  memory->Take(&w->partial, kMostThreads);
  memory->Take(&w->sums, 3 * (n / kShare + 1));
  memory->Take(&w->pair_particle, static_cast<long long>(n) * model.num_walls);
  memory->Take(&w->wall_numbers, 5LL * n * model.num_walls);
  memory->Take(&w->terms, 6LL * n * model.num_pushed);
  memory->Take(&w->impulses, 6 * model.num_pushed);
  w->neighbors.capacity = static_cast<long>(kListStride) * n + kListRoom;
  memory->Take(&w->neighbors.index, w->neighbors.capacity);
  Candidates* c = &w->neighbors.candidates;
  float** const of_candidates[] = {&c->x, &c->y, &c->z};
  for (float** a : of_candidates) memory->Take(a, n + kLanes);
  memory->Take(&c->index, n + kLanes);
  w->neighbors.begin = w->begin;
  w->neighbors.end = w->end;
  w->neighbors.most = kMostNeighbors;
  w->neighbors.e = nullptr, w->neighbors.stride = 0;  // Recomputed where needed.
  w->neighbors.too_many = w->step ? &w->step->too_many : nullptr;
}

}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_ENVIRONMENT_H_
