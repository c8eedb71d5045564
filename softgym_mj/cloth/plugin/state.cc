#include "cloth/plugin/state.h"

#include <algorithm>

#include "cloth/plugin/solids.h"

namespace softgym_mj::cloth {

// One number, two times three a vertex, one an edge, one a vertex, and the sides.
int StateSize(const mjModel* m) {
  return 1 + 7 * static_cast<int>(m->nflexvert) + static_cast<int>(m->nflexedge) + Solids::kNumSides;
}

bool HasState(const mjModel* m, const mjData* d, int instance) {
  return d->plugin_state[m->plugin_stateadr[instance]] == 1;
}

Kept StateOf(const mjModel* m, mjData* d, int instance, const Mesh& mesh, const Start& start) {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const size_t size = 3 * mesh.NumVertices();
  if (!HasState(m, d, instance)) {
    std::fill(state, state + StateSize(m), 0.0);
    state[0] = 1;
    std::copy(start.position.begin(), start.position.end(), state + 1);
  }
  double* edges = state + 1 + 2 * size;
  return {state + 1, state + 1 + size, edges, edges + mesh.edges.size()};
}

mjtNum* SidesOf(const mjModel* m, mjData* d, int instance) {
  return d->plugin_state + m->plugin_stateadr[instance] + StateSize(m) - Solids::kNumSides;
}

}  // namespace softgym_mj::cloth
