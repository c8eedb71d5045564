// The layout of the state in mjData, by which a step depends on those before it.

#ifndef SOFTGYM_MJ_CLOTH_STATE_H_
#define SOFTGYM_MJ_CLOTH_STATE_H_

#include <mujoco/mujoco.h>

#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

// What a step leaves for the next one, in the state. Rows begin where they have ended: else springs would let go at the
// start of each step, and piles would creep.
struct Kept {
  static constexpr int kPairs = 2;  // That are kept of a vertex, on average: a fold has one that pushes.

  double* reference;      // (n, 3) Positions that pairs of layers are found for [m].
  double* after_edge;     // (edges,) By how much edges got longer after their last sweep [m].
  double* holding_force;  // (n,) With which its edges pulled a held vertex, mean of the step [N]; of others 0.
  double* after_layers;   // (2 n, 4) Pairs of layers that push, see `Layers::Keep`.
};

// Numbers of the state: whether it is made, what `Kept` points to, and the sides of `Solids`.
int StateSize(const mjModel* m);
// Whether the state is made, in which case there is something to read in it.
bool HasState(const mjModel* m, const mjData* d, int instance);
// Whether positions, lengths and forces in it, if it is made, are finite and not huge; other numbers in it may be any.
bool IsSane(const mjModel* m, const mjData* d, int instance, const Mesh& mesh);
// Makes the state for the first step.
Kept StateOf(const mjModel* m, mjData* d, int instance, const Mesh& mesh, const Start& start);
mjtNum* SidesOf(const mjModel* m, mjData* d, int instance);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_STATE_H_
