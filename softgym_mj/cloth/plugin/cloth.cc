#include "cloth/plugin/cloth.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include <mujoco/mjplugin.h>

#include "cloth/plugin/motion.h"
#include "cloth/plugin/state.h"
#include "cloth/plugin/workspace.h"
#include "native/attributes.h"
#include "native/limits.h"
#include "native/reset.h"

namespace softgym_mj::cloth {
namespace {

constexpr const char* kAttributes[] = {
    "stretch",         "shear",        "bend",          "bend_weft", "bend_bias",
    "stretch_damping", "bend_damping", "friction",      "drag",      "added_mass",
    "contype",         "conaffinity",  "substeps",      "sweeps",    "contact_stiffness",
    "contact_damping", "twist",        "twist_clamped", "stiffening"};

// Returns the state size of a leading instance. The compiler calls it when only the sizes of flexes are known.
int NumState(const mjModel* m, int instance) {
  if (!Leads(m, instance)) return 0;
  char reason[kReasonSize];
  std::snprintf(reason, kReasonSize, "%s", kNoMemory);
  WithinMemory([&] { std::snprintf(reason, kReasonSize, "%s", CheckLimits(m).c_str()); });
  if (*reason) Fail(m, instance, reason);
  return StateSize(m) + TwistSize(m, Twists(m, instance));
}

// The compiler creates an mjData for every model, so errors in the model are raised here.
int Init(const mjModel* m, mjData* d, int instance) {
  char reason[kReasonSize];
  std::snprintf(reason, kReasonSize, "%s", kNoMemory);
  d->plugin_data[instance] = 0;
  if (!Leads(m, instance)) return 0;
  const bool tried = WithinMemory([&] {
    auto workspace = std::make_unique<Workspace>();
    const std::string error = Open(m, instance, workspace.get());
    if (error.empty() || IsRestarting()) SetWorkspace(d, std::move(workspace));
    std::snprintf(reason, kReasonSize, "%s", error.c_str());
  });
  if ((!tried || *reason) && !IsRestarting()) Fail(m, instance, reason);
  return 0;
}

// Stores data that MuJoCo will overwrite.
void Compute(const mjModel* m, mjData* d, int instance, int) {
  Workspace* w = Leads(m, instance) ? FindWorkspace(d) : nullptr;
  if (!w) return;
  w->advanced = true;
  Guard(m, d, instance, [&] {
    w->qpos.assign(d->qpos, d->qpos + m->nq);
    w->qvel.assign(d->qvel, d->qvel + m->nv);
    w->advanced = false;
  });
}

void TryToAdvance(const mjModel* m, mjData* d, int instance) {
  Workspace* w = Leads(m, instance) ? FindWorkspace(d) : nullptr;
  if (!w || w->advanced) return;
  w->advanced = true;
  const std::string error = Open(m, instance, w);
  if (!error.empty()) {
    char reason[kReasonSize];
    std::snprintf(reason, kReasonSize, "%s", error.c_str());
    return Warn(m, d, instance, reason);
  }
  if (w->qvel.size() != static_cast<size_t>(m->nv)) return;  // No step has been made yet.
  if (!Gather(m, d, w)) return;  // MuJoCo detects numbers that are not finite and resets in the next step.
  if (!IsSane(m, d, instance, w->mesh)) {
    Warn(m, d, instance, "NaN, Inf or huge numbers in plugin_state.");
    return Restart(m, d);
  }
  HoldTied(m, d, w);
  FindPlanes(m, d, w);
  const Kept kept = StateOf(m, d, instance, w->mesh, w->start);
  mjtNum* sides = SidesOf(m, d, instance);
  w->solids.Start(m, d, w->mesh, w->start, w->qvel.data(), sides, w->solver.substep());
  w->tied.Start(&w->solids.bodies(), m->opt.timestep, w->solver.substep(), &w->start);
  if (!w->solver.Step(w->mesh, w->start, w->planes, &w->solids, &w->tied, kept, &w->motion)) {
    Warn(m, d, instance, "too many vertices, edges and triangles are in one place: some contacts are left out.",
         mjWARN_CONTACTFULL);
  }
  Apply(d, *w);
  w->solids.Apply(m, d, w->settings.substeps);
  w->tied.Finish(m, d, &w->motion);
  w->solver.EndTwist(w->start, w->motion);
  ApplyToLed(m, d, *w);
  w->solids.KeepSides(sides);
}

void Advance(const mjModel* m, mjData* d, int instance) {
  Guard(m, d, instance, [&] { TryToAdvance(m, d, instance); });
}

}  // namespace

void AdvanceFlexes(const mjModel* m, mjData* d) {
  int instance;
  if (FindWorkspace(m, d, &instance)) Advance(m, d, instance);
}

void RegisterCloth() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = kPluginName;
  plugin.nattribute = sizeof(kAttributes) / sizeof(kAttributes[0]);
  plugin.attributes = kAttributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = NumState;
  plugin.init = Init;
  plugin.destroy = [](mjData* d, int) { SetWorkspace(d, nullptr); };
  plugin.copy = [](mjData* to, const mjModel* m, const mjData* from, int instance) {
    Workspace *into = FindWorkspace(to), *out_of = FindWorkspace(from);
    if (into && out_of) Guard(m, to, instance, [&] { into->Keep(*out_of); });
  };
  plugin.reset = [](const mjModel* m, mjtNum* state, void*, int instance) {
    std::fill(state, state + m->plugin_statenum[instance], 0.0);
  };
  plugin.compute = Compute;
  plugin.advance = Advance;
  mjp_registerPlugin(&plugin);
}

}  // namespace softgym_mj::cloth
