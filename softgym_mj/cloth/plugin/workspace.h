// What the plugin has in memory for each mjData, and how it is fitted to the model.

#ifndef SOFTGYM_MJ_CLOTH_WORKSPACE_H_
#define SOFTGYM_MJ_CLOTH_WORKSPACE_H_

#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/planes.h"
#include "cloth/plugin/solids.h"
#include "cloth/plugin/solver.h"
#include "cloth/plugin/start.h"
#include "cloth/plugin/tied.h"

namespace softgym_mj::cloth {

constexpr char kPluginName[] = "softgym_mj.cloth";

// Where a vertex is in the model.
struct Vertex {
  int body;
  int dof, qpos;  // Of its three slides; -1 if something else moves it.
  bool carried;   // Whether these are in a body that joints move.
};

// What an mjData needs for its steps. Only memory, the mesh and what vertices start a step with outlive a call;
// nothing that comes out depends on the steps before but by mjData.
struct Workspace {
  std::string signature, scratch;
  std::vector<int> flexes;
  Mesh mesh;
  std::vector<Vertex> vertices;
  std::vector<mjtNum> axes;        // World directions of the slides of each vertex (n, 3, 3).
  std::vector<mjtNum> local;       // Where each is in a parent that moves, at the start of the step (n, 3) [m].
  std::vector<mjtNum> qpos, qvel;  // Of all that moves, at the start of the step.
  bool advanced = true;            // Whether flexes are at its end.
  Start start;
  std::vector<PlaneContact> planes;
  Motion motion;
  Settings settings;
  Solids solids;
  Tied tied;
  Solver solver;

  // Takes over what a step that has begun needs.
  void Keep(const Workspace& other) {
    advanced = true;  // Until all of it is there.
    qpos = other.qpos;
    qvel = other.qvel;
    advanced = other.advanced;
  }
};

// One instance solves for all: the first one. Each flex has one that says what it is made of.
bool Leads(const mjModel* m, int instance);

// The workspace of an mjData; null of a stranger.
Workspace* FindWorkspace(const mjData* d);
// That of the instance that solves for all, which is `found`; null if the model has none.
Workspace* FindWorkspace(const mjModel* m, const mjData* d, int* found);
// Null to forget it.
void SetWorkspace(const mjData* d, std::unique_ptr<Workspace> workspace);

// Fits the workspace to the model. "" or what is wrong.
std::string Open(const mjModel* m, int instance, Workspace* w);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_WORKSPACE_H_
