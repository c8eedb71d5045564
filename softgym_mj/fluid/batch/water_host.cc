#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "batch/threads.h"
#include "fluid/batch/environment.h"
#include "fluid/batch/host.h"
#include "fluid/plugin/boundary.h"
#include "fluid/plugin/config.h"
#include "fluid/plugin/solver.h"
#include "native/export.h"
#include "native/instructions.h"
#include "native/pose.h"

namespace softgym_mj::fluid {
namespace {

constexpr char kPluginName[] = "softgym_mj.fluid";
constexpr int kCellsOfParticle = 2;  // Largest number of cells per particle, at least 64 in total.

auto ChooseStepOne() {
#ifdef SOFTGYM_MJ_X86
  return UseAvx2() ? StepOneAvx2 : StepOnePortable;
#else
  return StepOnePortable;
#endif
}

// Writes the model; returns "" or an error.
std::string Write(const mjModel* m, const mjData* d, const std::vector<int>& bodies, Model* model) {
  int instance = 0;
  for (; instance < m->nplugin; ++instance) {
    const mjpPlugin* plugin = mjp_getPluginAtSlot(m->plugin[instance]);
    if (plugin && std::strcmp(plugin->name, kPluginName) == 0) break;
  }
  if (instance == m->nplugin) return "there is no water.";
  FluidConfig config;
  std::vector<Wall> walls;
  std::string error = ParseConfig(m, instance, &config);
  if (error.empty()) error = CollectWalls(m, instance, config, &walls);
  if (!error.empty()) return error;
  if (config.flexes) return "expected water without flexes.";
  if (config.count > kMostParticles) return "expected at most " + std::to_string(kMostParticles) + " particles.";
  if (walls.size() > kMostWalls) return "expected at most " + std::to_string(kMostWalls) + " walls.";
  const double timestep = m->opt.timestep;
  *model = {};
  model->size = sizeof(Model);
  model->count = config.count;
  model->num_walls = static_cast<int>(walls.size());
  model->num_bodies = static_cast<int>(bodies.size());
  model->substeps = config.Substeps(timestep);
  model->most_cells = std::max(64, kCellsOfParticle * config.count);
  const Smoothing smoothing = MakeSmoothing(config, timestep);
  model->passes = smoothing.passes;
  model->viscosity = smoothing.viscosity;
  model->h = static_cast<float>(timestep / model->substeps);
  model->max_speed = static_cast<float>(MaxSpeed(config, timestep));
  model->reach = MaxSpeed(config, timestep) * timestep;
  mju_copy3(model->gravity, m->opt.gravity);
  model->mass = config.density * config.spacing * config.spacing * config.spacing;
  model->timestep = timestep;
  model->fluid = MakeConstants(config, model->h);
  for (size_t i = 0; i < walls.size(); ++i) {
    const Wall& wall = walls[i];
    BatchWall* out = model->walls + i;
    out->shape = wall.shape;
    std::copy(wall.size, wall.size + 3, out->size);
    const auto found = std::find(bodies.begin(), bodies.end(), wall.body);
    out->body = found == bodies.end() ? -1 : static_cast<int>(found - bodies.begin());
    out->pushed = config.two_way && out->body >= 0 && IsDynamic(m, wall.body) ? model->num_pushed++ : -1;
    mju_copy3(out->center, m->body_ipos + 3 * wall.body);
    if (out->body < 0) {
      if (!IsFixed(m, wall.body)) return "expected walls that are fixed or have prescribed motion.";
      const Pose pose = GeomPose(m, wall.geom, BodyPose(m, d, wall.body));
      mju_copy3(out->position, pose.position);
      mju_copy4(out->quaternion, pose.quaternion);
    } else {
      mju_copy3(out->position, m->geom_pos + 3 * wall.geom);
      mju_copy4(out->quaternion, m->geom_quat + 4 * wall.geom);
    }
  }
  return "";
}

}  // namespace
}  // namespace softgym_mj::fluid

// Writes the Model of a compiled mjModel, up to `capacity` bytes; `bodies` have prescribed motion. Returns the size in
// bytes, or 0 after writing a message to `error`.
SGM_EXPORT int softgym_mj_fluid_batch_model(const mjModel* m, const mjData* d, const int* bodies, int num_bodies,
                                            char* out, int capacity, char* error, int error_size) {
  using namespace softgym_mj::fluid;
  Model model;
  const std::string wrong = Write(m, d, std::vector<int>(bodies, bodies + num_bodies), &model);
  std::snprintf(error, error_size, "%s", wrong.c_str());
  if (!wrong.empty()) return 0;
  std::memcpy(out, &model, std::min<size_t>(sizeof(Model), capacity));
  return sizeof(Model);
}

// Returns bytes kept by an environment of a model, and bytes of scratch memory of a slot.
SGM_EXPORT void softgym_mj_fluid_batch_memory(const char* model, long long* sizes) {
  using namespace softgym_mj::fluid;
  const auto& description = *reinterpret_cast<const Model*>(model);
  softgym_mj::Memory kept(nullptr), memory(nullptr);
  Environment unused;
  TakeMemory(description, &memory, &unused);
  sizes[0] = kept.size(), sizes[1] = memory.size();
}

// Returns the numbers of particles, walls and bodies of a model, and the number of walls if it pushes one.
SGM_EXPORT void softgym_mj_fluid_batch_counts(const char* bytes, int* counts) {
  const auto& model = *reinterpret_cast<const softgym_mj::fluid::Model*>(bytes);
  counts[0] = model.count, counts[1] = model.num_walls, counts[2] = model.num_bodies;
  counts[3] = model.num_pushed ? model.num_walls : 0;
}

// Steps all environments by at most as many threads as slots; `turns`: order of iterations (group.h).
SGM_EXPORT void softgym_mj_fluid_batch_step(const softgym_mj::fluid::Batch* batch, int threads, int turns) {
  const auto step = softgym_mj::fluid::ChooseStepOne();
  softgym_mj::InThreads(batch->num_envs, threads, [&](int i, int slot) { step(*batch, i, slot, turns); });
}
