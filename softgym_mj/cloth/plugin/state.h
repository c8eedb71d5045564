// Layout of the plugin state in mjData.

#ifndef SOFTGYM_MJ_CLOTH_STATE_H_
#define SOFTGYM_MJ_CLOTH_STATE_H_

#include <mujoco/mujoco.h>

#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

// State that a step passes to the next one. Rows start as they ended: otherwise springs would relax at the start of
// each step, and piles would creep.
struct Kept {
  static constexpr int kPairs = 2;  // Stored pairs per vertex on average: a fold has one that pushes.

  double* reference;      // (n, 3) Reference positions for the search [m].
  double* after_edge;     // (edges,) Elongation of edges after their last sweep [m].
  double* holding_force;  // (n,) Mean force of the edges on a held vertex in the step [N]; 0 for others.
  double* after_layers;   // (2 n, 4) Pushing pairs of layers (`Layers::Keep`).
  double* twist;          // (flexes,) Twist angle of each flex [rad], if any flex twists.
};

// Size of the state without twist: whether it is initialized, the arrays of `Kept`, and the entry faces of `Solids`.
int StateSize(const mjModel* m);
// Size of the twist that follows if `twists`.
int TwistSize(const mjModel* m, bool twists);
// Whether the state is initialized.
bool HasState(const mjModel* m, const mjData* d, int instance);
// Whether its positions, lengths and forces, if initialized, are finite and not huge; other numbers are arbitrary.
bool IsSane(const mjModel* m, const mjData* d, int instance, const Mesh& mesh);
// Returns the state; initializes it in the first step.
Kept StateOf(const mjModel* m, mjData* d, int instance, const Mesh& mesh, const Start& start);
mjtNum* SidesOf(const mjModel* m, mjData* d, int instance);
mjtNum* TwistOf(const mjModel* m, const mjData* d, int instance);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_STATE_H_
