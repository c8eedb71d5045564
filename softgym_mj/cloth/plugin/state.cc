#include "cloth/plugin/state.h"

#include <algorithm>

#include "cloth/plugin/method.h"
#include "native/reset.h"

namespace softgym_mj::cloth {

// One number, three per vertex, one per edge, one per vertex, four per pair, and the entry faces.
int StateSize(const mjModel* m) {
  return 1 + (4 + 4 * Kept::kPairs) * static_cast<int>(m->nflexvert) + static_cast<int>(m->nflexedge) + kNumSides;
}

int TwistSize(const mjModel* m, bool twists) { return twists ? static_cast<int>(m->nflex) : 0; }

bool HasState(const mjModel* m, const mjData* d, int instance) {
  return d->plugin_state[m->plugin_stateadr[instance]] == 1;
}

bool IsSane(const mjModel* m, const mjData* d, int instance, const Mesh& mesh) {
  const int size = 1 + 4 * mesh.NumVertices() + static_cast<int>(mesh.edges.size());
  // The twist is set before the rest is initialized.
  const int twists = m->plugin_statenum[instance] - StateSize(m);
  if (!AreSane(TwistOf(m, d, instance), twists)) return false;
  return !HasState(m, d, instance) || AreSane(d->plugin_state + m->plugin_stateadr[instance], size);
}

Kept StateOf(const mjModel* m, mjData* d, int instance, const Mesh& mesh, const Start& start) {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const size_t count = mesh.NumVertices();
  if (!HasState(m, d, instance)) {
    std::fill(state, state + StateSize(m), 0.0);
    state[0] = 1;
    std::copy(start.position.begin(), start.position.end(), state + 1);
  }
  double *edges = state + 1 + 3 * count, *forces = edges + mesh.edges.size();
  return {state + 1, edges, forces, forces + count, TwistOf(m, d, instance)};
}

mjtNum* SidesOf(const mjModel* m, mjData* d, int instance) {
  return d->plugin_state + m->plugin_stateadr[instance] + StateSize(m) - kNumSides;
}

mjtNum* TwistOf(const mjModel* m, const mjData* d, int instance) {
  return d->plugin_state + m->plugin_stateadr[instance] + StateSize(m);
}

}  // namespace softgym_mj::cloth
