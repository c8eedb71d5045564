// Functions that Python calls after a step, exported by name.

#include <algorithm>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/state.h"
#include "cloth/plugin/workspace.h"
#include "native/export.h"

namespace softgym_mj::cloth {
namespace {

// Index of a vertex in mjModel; -1 for an unused one.
int ModelVertex(const mjModel* m, const Workspace& w, int vertex) {
  if (vertex >= w.mesh.NumVertices()) return -1;
  const int part = w.mesh.part[vertex];
  return m->flex_vertadr[w.mesh.flexes[part]] + vertex - w.mesh.first[part];
}

}  // namespace
}  // namespace softgym_mj::cloth

// Copies up to `capacity` contacts between geoms and flexes of the last step, with vertices of mjModel. Returns the
// total number of contacts.
SGM_EXPORT int softgym_mj_cloth_contacts(const mjModel* m, const mjData* d, softgym_mj::cloth::Contact* out,
                                         int capacity) {
  using namespace softgym_mj::cloth;
  int instance;
  const Workspace* w = FindWorkspace(m, d, &instance);
  if (!w) return 0;
  const std::vector<Contact>& contacts = w->solids.contacts();
  const int count = static_cast<int>(contacts.size());
  for (int i = 0; i < std::min(count, capacity); ++i) {
    out[i] = contacts[i];
    for (int& vertex : out[i].vertex) vertex = ModelVertex(m, *w, vertex);
  }
  return count;
}

// Returns where the twist angle [rad] of a flex of the model is in the plugin state; null if it does not twist.
SGM_EXPORT double* softgym_mj_cloth_twist(const mjModel* m, mjData* d, int flex) {
  using namespace softgym_mj::cloth;
  int instance;
  const Workspace* w = FindWorkspace(m, d, &instance);
  for (size_t p = 0; w && p < w->mesh.flexes.size(); ++p) {
    if (w->mesh.flexes[p] == flex && w->mesh.materials[p].twist > 0) return TwistOf(m, d, instance) + p;
  }
  return nullptr;
}

// Returns the mean force [N] of the flex on a held vertex of the model in the last step, from the plugin state.
SGM_EXPORT double softgym_mj_cloth_holding_force(const mjModel* m, mjData* d, int vertex) {
  using namespace softgym_mj::cloth;
  int instance;
  const Workspace* w = FindWorkspace(m, d, &instance);
  if (!w || !HasState(m, d, instance)) return 0;
  for (size_t p = 0; p < w->mesh.flexes.size(); ++p) {
    const int flex = w->mesh.flexes[p], first = m->flex_vertadr[flex];
    if (vertex < first || vertex >= first + m->flex_vertnum[flex]) continue;
    return StateOf(m, d, instance, w->mesh, w->start).holding_force[w->mesh.first[p] + vertex - first];
  }
  return 0;
}
