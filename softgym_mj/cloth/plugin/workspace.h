// Memory of the plugin for each mjData, and its setup for a model.

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

// Location of a vertex in the model.
struct Vertex {
  int body;
  int dof, qpos;  // Addresses of its three slides; -1 if it has none.
  bool carried;   // Whether the slides are in a body that joints move.
};

// Memory for the steps of an mjData. Only the mesh, the initial state of a step and scratch memory outlive a call;
// results depend on earlier steps only through mjData.
struct Workspace {
  std::string signature, scratch;
  std::vector<int> flexes;
  Mesh mesh;
  std::vector<Vertex> vertices;
  std::vector<mjtNum> axes;        // World directions of the slides of each vertex (n, 3, 3).
  std::vector<mjtNum> local;       // Position of each in its moving parent at the start of the step (n, 3) [m].
  std::vector<mjtNum> qpos, qvel;  // MuJoCo's state at the start of the step.
  bool advanced = true;            // Whether flexes have been advanced to the end of the step.
  Start start;
  std::vector<PlaneContact> planes;
  Motion motion;
  Settings settings;
  Solids solids;
  Tied tied;
  Solver solver;

  // Copies the data of a step that has begun.
  void Keep(const Workspace& other) {
    advanced = true;  // Invalid until the copy is complete.
    qpos = other.qpos;
    qvel = other.qvel;
    advanced = other.advanced;
  }
};

// Whether an instance is the leading one, the first, which solves for all. Each flex has one with its material.
bool Leads(const mjModel* m, int instance);

// Whether the material of any flex of an instance's kind twists.
bool Twists(const mjModel* m, int instance);

// Returns the workspace of an mjData; null if it has none.
Workspace* FindWorkspace(const mjData* d);
// Returns the workspace of the leading instance `found`; null if the model has none.
Workspace* FindWorkspace(const mjModel* m, const mjData* d, int* found);
// Sets the workspace of an mjData; null removes it.
void SetWorkspace(const mjData* d, std::unique_ptr<Workspace> workspace);

// Sets up the workspace for a model. Returns "" or an error.
std::string Open(const mjModel* m, int instance, Workspace* w);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_WORKSPACE_H_
