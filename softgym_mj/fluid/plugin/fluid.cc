#include "fluid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <mujoco/mjplugin.h>

#include "boundary.h"
#include "cloth/plugin/cloth.h"
#include "config.h"
#include "draw.h"
#include "native/attributes.h"
#include "native/flex.h"
#include "native/limits.h"
#include "native/reset.h"
#include "pushes.h"
#include "solver.h"
#include "sweep.h"

namespace softgym_mj {
namespace {

// Memory of a thread for a step. Only scratch memory and parsed attributes outlive a call; the latter are parsed again
// when they differ, so that results do not depend on earlier calls.
struct Workspace {
  std::string attributes;
  FluidConfig config;
  std::vector<Wall> walls;
  std::vector<Pose> start, end;
  FlexMotion flexes;
  std::vector<Impulse> impulses;
  std::vector<mjtNum> jacobian, solution;
  Solver solver;
  SurfaceExtractor surface;
};

Workspace& ThreadWorkspace() {
  thread_local Workspace workspace;
  return workspace;
}

// Parses the attributes; returns "" or an error.
std::string Configure(const mjModel* m, int instance, Workspace* w) {
  std::string error, attributes = RawAttributes(m, instance);
  if (attributes != w->attributes) {
    w->attributes.clear();  // Invalid until all attributes are parsed.
    error = ParseConfig(m, instance, &w->config);
    if (error.empty()) w->attributes = attributes;
  }
  return error;
}

// Parses the attributes and finds walls and flexes; returns false and a reason if they are invalid.
bool Bind(const mjModel* m, int instance, Workspace* w, char* reason) {
  std::snprintf(reason, kReasonSize, "%s", kNoMemory);
  const bool tried = WithinMemory([&] {
    std::string error = CheckLimits(m);
    if (error.empty()) error = Configure(m, instance, w);
    if (error.empty()) error = CollectWalls(m, instance, w->config, &w->walls);
    w->flexes.elements.clear();
    if (error.empty() && w->config.flexes) error = CollectFlexes(m, &w->flexes.elements);
    std::snprintf(reason, kReasonSize, "%s", error.c_str());
  });
  return tried && !*reason;
}

StateLayout Layout(const mjModel* m, const FluidConfig& config, size_t num_walls) {
  const int walls = static_cast<int>(num_walls);
  StateLayout layout;
  layout.known = 0;
  layout.positions = 1;
  layout.velocities = layout.positions + 3 * config.count;
  layout.poses = layout.velocities + 3 * config.count;
  layout.forces = layout.poses + 7 * walls;
  layout.pending = layout.forces + (config.two_way ? 6 * walls : 0);
  layout.vertices = layout.pending + (config.two_way ? 6 * walls : 0);
  layout.size = layout.vertices + (config.flexes ? 3 * m->nflexvert : 0);
  return layout;
}

// Returns the workspace of an instance and the layout of its state; null and a reason if the model was changed after
// compilation so that they do not fit.
Workspace* Open(const mjModel* m, int instance, StateLayout* layout, char* reason) {
  Workspace& w = ThreadWorkspace();
  if (!Bind(m, instance, &w, reason)) return nullptr;
  *layout = Layout(m, w.config, w.walls.size());
  if (layout->size == m->plugin_statenum[instance]) return &w;
  std::snprintf(reason, kReasonSize,
                "walls were added or removed, by contype, conaffinity or "
                "geom_type, after the model was compiled: the fluid is not stepped.");
  return nullptr;
}

// Returns the size of the state. The compiler calls it before flexes exist.
int NumState(const mjModel* m, int instance) {
  char reason[kReasonSize];
  Workspace& w = ThreadWorkspace();
  if (!Bind(m, instance, &w, reason)) Fail(m, instance, reason);
  if (w.config.two_way && (m->opt.disableflags & mjDSBL_SPRING) && (m->opt.disableflags & mjDSBL_DAMPER)) {
    Fail(m, instance,
         "two_way=\"true\" needs MuJoCo's passive forces, which the flags spring and "
         "damper disable: enable one of them.");
  }
  const double most = MaxViscosity(w.config, m->opt.timestep);
  if (w.config.viscosity > most) {
    std::snprintf(reason, sizeof(reason),
                  "attribute viscosity=\"%g\" is not valid: with this spacing and time step "
                  "expected at most %g.",
                  w.config.viscosity, most);
    Fail(m, instance, reason);
  }
  return Layout(m, w.config, w.walls.size()).size;
}

// The compiler creates an mjData for every model, so errors in the model are raised here at the latest.
int Init(const mjModel* m, mjData* d, int instance) {
  char reason[kReasonSize];
  if (!Bind(m, instance, &ThreadWorkspace(), reason) && !IsRestarting()) Fail(m, instance, reason);
  d->plugin_data[instance] = 0;
  return 0;
}

void Reset(const mjModel* m, mjtNum* state, void*, int instance) {
  Workspace& w = ThreadWorkspace();
  const int size = m->plugin_statenum[instance];
  mju_zero(state, size);
  WithinMemory([&] {
    if (Configure(m, instance, &w).empty() && 1 + 3 * w.config.count <= size) {
      w.config.PlaceLattice(state + 1);
    }
  });
}

// Finds current poses of walls and vertices; returns false if a number is not finite or huge.
bool FindPoses(const mjModel* m, const mjData* d, Workspace* w) {
  w->end.resize(w->walls.size());
  Pose body;
  for (size_t i = 0; i < w->walls.size(); ++i) {
    const Wall& wall = w->walls[i];
    if (i == 0 || wall.body != w->walls[i - 1].body) body = BodyPose(m, d, wall.body);
    w->end[i] = GeomPose(m, wall.geom, body);
    if (!IsSane(w->end[i])) return false;
  }
  return !w->config.flexes || FindVertices(m, d, &w->flexes.end);
}

void StorePoses(const std::vector<Pose>& poses, mjtNum* stored) {
  for (const Pose& pose : poses) {
    mju_copy3(stored, pose.position);
    mju_copy4(stored + 3, pose.quaternion);
    stored += 7;
  }
}

// Sets the start of walls to their stored poses at the end of the last step, unless these are further away than
// `reach`; returns whether one is.
bool SweepWalls(double reach, const mjtNum* stored, Workspace* w) {
  bool jumped = false;
  for (size_t i = 0; i < w->walls.size(); ++i, stored += 7) {
    const mjtNum *p = w->end[i].position, *q = w->end[i].quaternion;
    const double now[7] = {p[0], p[1], p[2], q[0], q[1], q[2], q[3]};
    if (WayOfWall(w->walls[i].shape, w->walls[i].size, stored, now) <= reach) {
      mju_copy3(w->start[i].position, stored);
      mju_copy4(w->start[i].quaternion, stored + 3);
    } else {
      jumped = true;
    }
  }
  return jumped;
}

// Sets the motion of vertices from their stored positions at the end of the last step, unless these are unknown or
// further away than `reach`, to the current ones, which it stores.
void SweepVertices(bool known, double reach, mjtNum* stored, FlexMotion* flexes) {
  const int size = static_cast<int>(flexes->end.size());
  flexes->start = flexes->end;
  for (int i = 0; i < size; i += 3) {
    if (known && mju_dist3(stored + i, &flexes->end[i]) <= reach) {
      mju_copy3(&flexes->start[i], stored + i);
    }
  }
  mju_copy(stored, flexes->end.data(), size);
}

// Converts the impulses of this step to forces of the next one.
void HandOver(const mjModel* m, mjData* d, Workspace* w, mjtNum* forces, mjtNum* pending) {
  const double dt = m->opt.timestep;
  const size_t walls = w->walls.size();
  for (size_t first = 0, last; first < walls; first = last) {
    const int body = w->walls[first].body;
    for (last = first; last < walls && w->walls[last].body == body; ++last) {
    }
    if (!IsDynamic(m, body)) continue;
    const Pose pose = BodyPose(m, d, body);
    mjtNum center[3];
    mju_rotVecQuat(center, m->body_ipos + 3 * body, pose.quaternion);
    mju_addTo3(center, pose.position);
    // Inverse inertia of the body, with everything it is jointed to.
    const int nv = m->nv;
    w->jacobian.resize(6 * nv);
    w->solution.resize(6 * nv);
    mj_jac(m, d, w->jacobian.data(), w->jacobian.data() + 3 * nv, d->xipos + 3 * body, body);
    mj_solveM(m, d, w->solution.data(), w->jacobian.data(), 6);
    double mobility[2] = {0, 0};
    for (int k = 0; k < 6; ++k) {
      const double a = mju_dot(w->jacobian.data() + k * nv, w->solution.data() + k * nv, nv);
      mobility[k / 3] = std::max(mobility[k / 3], a);
    }
    double inertia[2] = {0, 0};  // Mass and moment of inertia of the water near the body.
    w->solver.TouchingInertia(first, last, center, inertia);
    for (size_t i = first; i < last; ++i) {
      const Impulse& impulse = w->impulses[i];
      PassOn(impulse.linear, impulse.angular, center, inertia, mobility, dt, pending + 6 * i, forces + 6 * i);
    }
  }
}

void TryToAdvance(const mjModel* m, mjData* d, int instance) {
  cloth::AdvanceFlexes(m, d);
  StateLayout layout;
  char reason[kReasonSize];
  Workspace* opened = Open(m, instance, &layout, reason);
  if (!opened) {
    Warn(m, d, instance, reason);
    return;
  }
  Workspace& w = *opened;
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  if (!AreSane(state + layout.positions, layout.poses - layout.positions)) {
    Warn(m, d, instance, "NaN, Inf or huge particle positions or velocities in plugin_state.");
    return Restart(m, d);
  }
  if (!FindPoses(m, d, &w)) {
    Warn(m, d, instance, "NaN, Inf or huge poses of walls or of vertices of flexes.");
    return Restart(m, d);
  }
  w.start = w.end;
  const double reach = MaxSpeed(w.config, m->opt.timestep) * m->opt.timestep;
  const bool known = state[layout.known] != 0;
  if (known && SweepWalls(reach, state + layout.poses, &w)) {
    std::snprintf(reason, sizeof(reason),
                  "a wall moves further than %g m in a step (max_speed, or 0.9 spacings in a substep): it counts as "
                  "teleported and may leave water behind.",
                  reach);
    Warn(m, d, instance, reason, mjWARN_BADQVEL);
  }
  if (w.config.flexes) SweepVertices(known, reach, state + layout.vertices, &w.flexes);
  StorePoses(w.end, state + layout.poses);
  state[layout.known] = 1;
  w.impulses.resize(w.walls.size());
  const mjtNum none[3] = {0, 0, 0};
  const mjtNum* gravity = m->opt.disableflags & mjDSBL_GRAVITY ? none : m->opt.gravity;
  const bool counted =
      w.solver.Step(w.config, m->opt.timestep, gravity, w.walls, w.start, w.end, w.flexes, state + layout.positions,
                    state + layout.velocities, w.config.two_way ? w.impulses.data() : nullptr);
  if (!counted) {
    Warn(m, d, instance, "too many particles, or elements of flexes, are in one place: some are left out.",
         mjWARN_CONTACTFULL);
  }
  if (w.config.two_way) HandOver(m, d, &w, state + layout.forces, state + layout.pending);
}

void Advance(const mjModel* m, mjData* d, int instance) {
  Guard(m, d, instance, [&] { TryToAdvance(m, d, instance); });
}

// Adds the forces of the last step to the passive forces. Before the first step it stores the poses of walls, so that
// their first motion is swept like any other.
void TryToCompute(const mjModel* m, mjData* d, int instance) {
  StateLayout layout;
  char reason[kReasonSize];
  Workspace* opened = Open(m, instance, &layout, reason);
  if (!opened) return;  // The step will report the reason.
  Workspace& w = *opened;
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  if (!state[layout.known] && FindPoses(m, d, &w)) {
    StorePoses(w.end, state + layout.poses);
    if (w.config.flexes) mju_copy(state + layout.vertices, w.flexes.end.data(), 3 * m->nflexvert);
    state[layout.known] = 1;
  }
  if (!w.config.two_way) return;
  const mjtNum* force = state + layout.forces;
  for (size_t i = 0; i < w.walls.size(); ++i, force += 6) {
    const int body = w.walls[i].body;
    if (IsDynamic(m, body)) {
      mj_applyFT(m, d, force, force + 3, d->xipos + 3 * body, body, d->qfrc_passive);
    }
  }
}

void Compute(const mjModel* m, mjData* d, int instance, int) {
  Guard(m, d, instance, [&] { TryToCompute(m, d, instance); });
}

// Group of skins that a viewer shows if it writes the surface of water into a skin (rendering/skins.py).
constexpr int kDrawnSkins = 5;

void Visualize(const mjModel* m, mjData* d, const mjvOption* option, mjvScene* scene, int instance) {
  if (option->skingroup[kDrawnSkins]) return;
  StateLayout layout;
  char reason[kReasonSize];
  Workspace* w = Open(m, instance, &layout, reason);
  if (!w) return;
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const bool drawn =
      WithinMemory([&] { DrawFluid(m, w->config, instance, state + layout.positions, &w->surface, scene); });
  if (!drawn) scene->status = 1;  // As where geoms have no room.
}

}  // namespace

void RegisterFluid() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "softgym_mj.fluid";
  plugin.nattribute = kNumAttributes;
  plugin.attributes = kAttributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = NumState;
  plugin.init = Init;
  plugin.reset = Reset;
  plugin.compute = Compute;
  plugin.advance = Advance;
  plugin.visualize = Visualize;
  mjp_registerPlugin(&plugin);
}

}  // namespace softgym_mj
