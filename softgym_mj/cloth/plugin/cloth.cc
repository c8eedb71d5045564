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
#include "native/reset.h"

namespace softgym_mj::cloth {
namespace {

constexpr const char* kAttributes[] = {
    "stretch",    "shear",   "bend",        "stretch_damping", "bend_damping", "friction",          "drag",
    "added_mass", "contype", "conaffinity", "substeps",        "sweeps",       "contact_stiffness", "contact_damping"};

// The compiler makes an mjData of every model, so what is wrong is found there.
int Init(const mjModel* m, mjData* d, int instance) {
  char reason[kReasonSize] = "";
  d->plugin_data[instance] = 0;
  if (!Leads(m, instance)) return 0;
  bool failed;
  {
    auto workspace = std::make_unique<Workspace>();
    const std::string error = Open(m, instance, workspace.get());
    std::snprintf(reason, kReasonSize, "%s", error.c_str());
    failed = !error.empty() && !IsRestarting();
    if (!failed) SetWorkspace(d, std::move(workspace));
  }
  if (failed) Fail(m, instance, reason);
  return 0;
}

// Keeps what MuJoCo is about to overwrite.
void Compute(const mjModel* m, mjData* d, int instance, int) {
  Workspace* w = Leads(m, instance) ? FindWorkspace(d) : nullptr;
  if (!w) return;
  w->qpos.assign(d->qpos, d->qpos + m->nq);
  w->qvel.assign(d->qvel, d->qvel + m->nv);
  w->advanced = false;
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
  if (w->qvel.size() != static_cast<size_t>(m->nv)) return;  // There was no step yet.
  if (!Gather(m, d, w)) return;  // MuJoCo finds what is not finite and resets in the next step.
  HoldTied(m, d, w);
  FindPlanes(m, d, w);
  const Kept kept = StateOf(m, d, instance, w->mesh, w->start);
  mjtNum* sides = SidesOf(m, d, instance);
  w->solids.Start(m, d, w->mesh, w->start, w->qvel.data(), sides, w->solver.substep());
  w->solver.Step(w->mesh, w->start, w->planes, &w->solids, kept, &w->motion);
  Apply(d, *w, m->opt.timestep);
  w->solids.Apply(m, d, w->settings.substeps);
  w->solids.KeepSides(sides);
}

void Advance(const mjModel* m, mjData* d, int instance) {
  if (!WithinMemory([&] { TryToAdvance(m, d, instance); })) Warn(m, d, instance, kNoMemory);
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
  // Of those that lead, but tables that tell so may not be filled yet.
  plugin.nstate = [](const mjModel* m, int instance) { return Leads(m, instance) ? StateSize(m) : 0; };
  plugin.init = Init;
  plugin.destroy = [](mjData* d, int) { SetWorkspace(d, nullptr); };
  plugin.copy = [](mjData* to, const mjModel*, const mjData* from, int) {
    Workspace *into = FindWorkspace(to), *out_of = FindWorkspace(from);
    if (into && out_of) into->Keep(*out_of);
  };
  plugin.reset = [](const mjModel* m, mjtNum* state, void*, int instance) {
    std::fill(state, state + m->plugin_statenum[instance], 0.0);
  };
  plugin.compute = Compute;
  plugin.advance = Advance;
  mjp_registerPlugin(&plugin);
}

}  // namespace softgym_mj::cloth
