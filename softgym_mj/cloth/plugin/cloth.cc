#include "cloth/plugin/cloth.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <mujoco/mjplugin.h>

#include "cloth/plugin/solids.h"
#include "cloth/plugin/solver.h"
#include "native/attributes.h"
#include "native/pose.h"
#include "native/reset.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr const char* kName = "softgym_mj.cloth";
constexpr const char* kAttributes[] = {
    "stretch",    "shear",   "bend",        "stretch_damping", "bend_damping", "friction",          "drag",
    "added_mass", "contype", "conaffinity", "substeps",        "sweeps",       "contact_stiffness", "contact_damping"};

// [kg] A vertex that counts as heavier in mjModel.dof_M0 is held: it keeps the velocity that it is given.
constexpr double kHeldMass = 1;

// Where a vertex is in the model.
struct Vertex {
  int body;
  int dof, qpos;  // Of its three slides; -1 if something else moves it.
};

// What an mjData needs for its steps. Only memory, the mesh and what vertices start a step with outlive a call;
// nothing that comes out depends on the steps before but by mjData.
struct Workspace {
  std::string signature, scratch;
  std::vector<int> flexes;
  Mesh mesh;
  std::vector<Vertex> vertices;
  std::vector<mjtNum> axes;        // World directions of the slides of each vertex (n, 3, 3).
  std::vector<mjtNum> carried;     // How far a parent that moves carries each vertex in the step (n, 3) [m].
  std::vector<mjtNum> qpos, qvel;  // Of all that moves, at the start of the step.
  bool advanced = true;            // Whether flexes are at its end.
  Start start;
  std::vector<PlaneContact> planes;
  Motion motion;
  Settings settings;
  Solids solids;
  Solver solver;

  // Takes over what a step that has begun needs.
  void Keep(const Workspace& other) {
    qpos = other.qpos;
    qvel = other.qvel;
    advanced = other.advanced;
  }
};

// The workspace of each mjData; null of a stranger. Not in plugin_data: what copies an mjData byte by byte, as pickles
// do, would copy the pointer as well.
class Workspaces {
 public:
  Workspace* Find(const mjData* d) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = of_.find(d);
    return found == of_.end() ? nullptr : found->second.get();
  }
  void Set(const mjData* d, std::unique_ptr<Workspace> workspace) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (workspace) {
      of_[d] = std::move(workspace);
    } else {
      of_.erase(d);
    }
  }

 private:
  std::mutex mutex_;
  std::unordered_map<const mjData*, std::unique_ptr<Workspace>> of_;
};

Workspaces& All() {
  static Workspaces* workspaces = new Workspaces;  // Never destroyed: mjData may outlive what is.
  return *workspaces;
}

// One instance solves for all: the first one. Each flex has one that says what it is made of.
bool Leads(const mjModel* m, int instance) {
  return std::find(m->plugin, m->plugin + instance, m->plugin[instance]) == m->plugin + instance;
}

std::string FlexName(const mjModel* m, int flex) {
  const char* name = mj_id2name(m, mjOBJ_FLEX, flex);
  return "flex " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(flex));
}

// The instance of this plugin that carries a flex, or -1.
int InstanceOf(const mjModel* m, int flex, int slot) {
  for (int v = m->flex_vertadr[flex]; v < m->flex_vertadr[flex] + m->flex_vertnum[flex]; ++v) {
    const int instance = m->body_plugin[m->flex_vertbodyid[v]];
    if (instance >= 0 && m->plugin[instance] == slot) return instance;
  }
  return -1;
}

std::string CheckFlex(const mjModel* m, int f) {
  if (m->flex_dim[f] > 2 || m->flex_interp[f] || m->flex_rigid[f]) {
    return FlexName(m, f) +
           " cannot be handled: expected a deformable one of dimension 1 or 2 with vertices, "
           "dof=\"full\".";
  }
  if (m->flex_selfcollide[f] != mjFLEXSELF_NONE || m->flex_contype[f] || m->flex_conaffinity[f]) {
    return FlexName(m, f) +
           " would collide twice: expected <contact selfcollide=\"none\" contype=\"0\" "
           "conaffinity=\"0\"/>.";
  }
  if (m->flex_edgeequality[f])
    return FlexName(m, f) + " would be stretched twice: expected <edge equality=\"false\"/>.";
  return "";
}

std::string ParseMaterial(const mjModel* m, int instance, Material* out) {
  AttributeReader read(m, instance);
  read.Numbers("stretch", &out->stretch, 1, 1e-3, 1e6);
  read.Numbers("shear", &out->shear, 1, 1e-3, 1);
  read.Numbers("bend", &out->bend, 1, 0, 1);
  read.Numbers("stretch_damping", &out->stretch_damping, 1, 0, 1);
  read.Numbers("bend_damping", &out->bend_damping, 1, 0, 1);
  read.Numbers("friction", &out->friction, 1, 0, 10);
  read.Numbers("drag", &out->drag, 1, 0, 100);
  read.Numbers("added_mass", &out->added_mass, 1, 0, 100);
  read.Numbers("contype", &out->contype, 1, 0, 1 << 30);
  read.Numbers("conaffinity", &out->conaffinity, 1, 0, 1 << 30);
  return read.error();
}

std::string ParseSettings(const mjModel* m, int instance, Settings* out) {
  AttributeReader read(m, instance);
  read.Numbers("substeps", &out->substeps, 1, 1, 1000);
  read.Numbers("sweeps", &out->sweeps, 1, 1, 1000);
  read.Numbers("contact_stiffness", &out->contact_stiffness, 1, 1, 1e7);
  read.Numbers("contact_damping", &out->contact_damping, 1, 0, 1);
  return read.error();
}

Vertex FindVertex(const mjModel* m, int body) {
  const int joint = m->body_jntadr[body];
  bool slides = m->body_jntnum[body] == 3;
  for (int j = joint; slides && j < joint + 3; ++j) slides = m->jnt_type[j] == mjJNT_SLIDE;
  if (!slides) return {body, -1, -1};
  return {body, m->body_dofadr[body], m->jnt_qposadr[joint]};
}

// Fits the workspace to the model. "" or what is wrong.
std::string Open(const mjModel* m, int instance, Workspace* w) {
  w->flexes.clear();
  std::vector<Material> materials;
  for (int f = 0; f < m->nflex; ++f) {
    const int of_flex = InstanceOf(m, f, m->plugin[instance]);
    if (of_flex < 0) continue;
    std::string error = CheckFlex(m, f);
    materials.emplace_back();
    if (error.empty()) error = ParseMaterial(m, of_flex, &materials.back());
    if (!error.empty()) return error;
    w->flexes.push_back(f);
  }
  if (w->flexes.empty()) return "no flex carries it: expected <plugin instance=\"...\"/> inside a flexcomp.";
  if (m->opt.integrator == mjINT_RK4) {
    return "integrator RK4 is not supported: expected Euler, implicit, implicitfast or discrete.";
  }
  if (m->opt.enableflags & mjENBL_SLEEP) return "the flag sleep is not supported.";
  if ((m->opt.disableflags & mjDSBL_SPRING) && (m->opt.disableflags & mjDSBL_DAMPER)) {
    return "the plugin needs MuJoCo's passive forces, which the flags spring and damper disable: enable one of them.";
  }
  Settings settings;
  const std::string error = ParseSettings(m, instance, &settings);
  if (!error.empty()) return error;
  WriteSignature(m, w->flexes, &w->scratch);
  w->scratch.append(reinterpret_cast<const char*>(materials.data()), materials.size() * sizeof(Material));
  w->scratch.append(reinterpret_cast<const char*>(&settings), sizeof(settings));
  w->scratch.append(reinterpret_cast<const char*>(&m->opt.timestep), sizeof(mjtNum));
  if (w->scratch == w->signature) return "";
  w->signature = w->scratch;
  w->mesh = MakeMesh(m, w->flexes, materials);
  w->solver.Reset(w->mesh, settings, m->opt.timestep);
  w->settings = settings;
  const std::string wrong = CheckGeoms(m, w->mesh);
  if (!wrong.empty()) return wrong;
  w->vertices.clear();
  for (int f : w->flexes) {
    const int* body = m->flex_vertbodyid + m->flex_vertadr[f];
    for (int i = 0; i < m->flex_vertnum[f]; ++i) w->vertices.push_back(FindVertex(m, body[i]));
  }
  return "";
}

// Pose of a body at the start of the step, from mjData.
Pose StartPose(const mjData* d, int body) {
  Pose pose;
  mju_copy3(pose.position, d->xpos + 3 * body);
  mju_copy4(pose.quaternion, d->xquat + 4 * body);
  return pose;
}

// Fills what the vertices start with; false if something is not finite.
bool Gather(const mjModel* m, const mjData* d, Workspace* w) {
  const int count = w->mesh.NumVertices();
  const double dt = m->opt.timestep;
  Start& start = w->start;
  for (auto* a : {&start.position, &start.velocity, &start.acceleration}) a->assign(3 * count, 0);
  start.inverse_mass.assign(count, 0);
  start.mass = w->mesh.mass;
  w->axes.resize(9 * count);
  w->carried.assign(3 * count, 0);
  double sum = 0;
  for (int v = 0; v < count; ++v) {
    const int part = w->mesh.part[v], flex = w->mesh.flexes[part];
    const int address = m->flex_vertadr[flex] + v - w->mesh.first[part];
    const Vertex& vertex = w->vertices[v];
    mju_copy3(&start.position[3 * v], d->flexvert_xpos + 3 * address);
    if (vertex.dof < 0) {
      // Its body carries it, from its pose at the start to that at the end.
      const Pose pose = BodyPose(m, d, vertex.body);
      mjtNum end[3];
      mju_rotVecQuat(end, m->flex_vert + 3 * address, pose.quaternion);
      mju_addTo3(end, pose.position);
      for (int k = 0; k < 3; ++k) start.velocity[3 * v + k] = (end[k] - start.position[3 * v + k]) / dt;
    } else {
      const int body = vertex.body, joint = m->body_jntadr[body];
      const int parent = m->body_parentid[body];
      const Pose from = StartPose(d, parent);
      if (m->body_treeid[parent] >= 0) {
        const Pose to = BodyPose(m, d, parent);
        mjtNum local[3], back[4], *carried = &w->carried[3 * v];
        mju_sub3(local, &start.position[3 * v], from.position);
        mju_negQuat(back, from.quaternion);
        mju_rotVecQuat(local, local, back);
        mju_rotVecQuat(carried, local, to.quaternion);
        mju_addTo3(carried, to.position);
        mju_subFrom3(carried, &start.position[3 * v]);
        mju_addToScl3(&start.velocity[3 * v], carried, 1 / dt);
      }
      mjtNum quaternion[4];
      mju_mulQuat(quaternion, from.quaternion, m->body_quat + 4 * body);
      const double mass = m->dof_M0[vertex.dof];
      const bool held = mass > kHeldMass;
      start.inverse_mass[v] = held ? 0 : static_cast<float>(1 / mass);
      for (int k = 0; k < 3; ++k) {
        mjtNum* axis = &w->axes[9 * v + 3 * k];
        mju_rotVecQuat(axis, m->jnt_axis + 3 * (joint + k), quaternion);
        const double before = w->qvel[vertex.dof + k], after = d->qvel[vertex.dof + k];
        mju_addToScl3(&start.velocity[3 * v], axis, before);
        if (!held) mju_addToScl3(&start.acceleration[3 * v], axis, (after - before) / dt);
      }
    }
    for (int k = 0; k < 3; ++k)
      sum += start.position[3 * v + k] + start.velocity[3 * v + k] + start.acceleration[3 * v + k];
  }
  return std::isfinite(sum);
}

// Vertices that an equality ties to something else move as MuJoCo has moved them.
void HoldTied(const mjModel* m, const mjData* d, Workspace* w) {
  for (int e = 0; e < m->neq; ++e) {
    const bool ties = m->eq_type[e] == mjEQ_CONNECT || m->eq_type[e] == mjEQ_WELD;
    if (!ties || !d->eq_active[e] || m->eq_objtype[e] != mjOBJ_BODY) continue;
    int found[2] = {-1, -1};
    for (size_t v = 0; v < w->vertices.size(); ++v) {
      if (w->vertices[v].body == m->eq_obj1id[e]) found[0] = static_cast<int>(v);
      if (w->vertices[v].body == m->eq_obj2id[e]) found[1] = static_cast<int>(v);
    }
    if ((found[0] < 0) == (found[1] < 0)) continue;  // Neither, or two that are sewn together.
    const int v = std::max(found[0], found[1]);
    if (w->vertices[v].dof < 0) continue;
    w->start.inverse_mass[v] = 0;
    for (int k = 0; k < 3; ++k) {
      w->start.velocity[3 * v + k] += m->opt.timestep * w->start.acceleration[3 * v + k];
      w->start.acceleration[3 * v + k] = 0;
    }
  }
}

void FindPlanes(const mjModel* m, const mjData* d, Workspace* w) {
  w->planes.clear();
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_type[g] != mjGEOM_PLANE) continue;
    PlaneContact plane = {g, {}, {}, {}, {}};
    for (int k = 0; k < 3; ++k) {
      plane.point[k] = d->geom_xpos[3 * g + k];
      plane.normal[k] = d->geom_xmat[9 * g + 3 * k + 2];
    }
    bool touches = false;
    for (size_t p = 0; p < w->mesh.flexes.size(); ++p) {
      plane.touches.push_back(MayTouch(m, g, w->mesh, static_cast<int>(p)));
      plane.friction.push_back(static_cast<float>(Friction(m, g, w->mesh.flexes[p])));
      touches |= plane.touches.back();
    }
    if (touches) w->planes.push_back(plane);
  }
}

// Writes the motion to qvel and qpos.
void Apply(mjData* d, const Workspace& w, double dt) {
  for (int v = 0; v < w.mesh.NumVertices(); ++v) {
    if (w.vertices[v].dof < 0) continue;
    const Vector carried = FromArray(&w.carried[3 * v]), move = FromArray(&w.motion.move[3 * v]) - carried;
    const Vector velocity = FromArray(&w.motion.velocity[3 * v]) - (1 / dt) * carried;
    for (int k = 0; k < 3; ++k) {
      const Vector axis = FromArray(&w.axes[9 * v + 3 * k]);
      d->qvel[w.vertices[v].dof + k] = Dot(axis, velocity);
      d->qpos[w.vertices[v].qpos + k] = w.qpos[w.vertices[v].qpos + k] + Dot(axis, move);
    }
  }
}

// What the state in mjData keeps: whether it is made, two times three numbers a vertex, one an edge, one a vertex, and
// the sides of `Solids`.
int StateSize(const mjModel* m) {
  return 1 + 7 * static_cast<int>(m->nflexvert) + static_cast<int>(m->nflexedge) + Solids::kNumSides;
}

mjtNum* SidesOf(const mjModel* m, mjData* d, int instance) {
  return d->plugin_state + m->plugin_stateadr[instance] + StateSize(m) - Solids::kNumSides;
}

// Makes the state for the first step.
Kept StateOf(const mjModel* m, mjData* d, int instance, const Workspace& w) {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  const size_t size = 3 * w.mesh.NumVertices();
  if (state[0] != 1) {
    std::fill(state, state + StateSize(m), 0.0);
    state[0] = 1;
    std::copy(w.start.position.begin(), w.start.position.end(), state + 1);
  }
  double* edges = state + 1 + 2 * size;
  return {state + 1, state + 1 + size, edges, edges + w.mesh.edges.size()};
}

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
    if (!failed) All().Set(d, std::move(workspace));
  }
  if (failed) Fail(m, instance, reason);
  return 0;
}

// Keeps what MuJoCo is about to overwrite.
void Compute(const mjModel* m, mjData* d, int instance, int) {
  Workspace* w = Leads(m, instance) ? All().Find(d) : nullptr;
  if (!w) return;
  w->qpos.assign(d->qpos, d->qpos + m->nq);
  w->qvel.assign(d->qvel, d->qvel + m->nv);
  w->advanced = false;
}

void TryToAdvance(const mjModel* m, mjData* d, int instance) {
  Workspace* w = Leads(m, instance) ? All().Find(d) : nullptr;
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
  const Kept kept = StateOf(m, d, instance, *w);
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

namespace {

// The workspace of the instance that solves for all; null if the model has none.
const Workspace* FindWorkspace(const mjModel* m, const mjData* d, int* found) {
  for (int instance = 0; instance < m->nplugin; ++instance) {
    *found = instance;
    const mjpPlugin* plugin = mjp_getPluginAtSlot(m->plugin[instance]);
    if (plugin && std::strcmp(plugin->name, kName) == 0 && Leads(m, instance)) return All().Find(d);
  }
  return nullptr;
}

// Index of a vertex in mjModel; -1 for none.
int ModelVertex(const mjModel* m, const Workspace& w, int vertex) {
  if (vertex >= w.mesh.NumVertices()) return -1;
  const int part = w.mesh.part[vertex];
  return m->flex_vertadr[w.mesh.flexes[part]] + vertex - w.mesh.first[part];
}

}  // namespace

void AdvanceFlexes(const mjModel* m, mjData* d) {
  int instance;
  if (FindWorkspace(m, d, &instance)) Advance(m, d, instance);
}

void RegisterCloth() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = kName;
  plugin.nattribute = sizeof(kAttributes) / sizeof(kAttributes[0]);
  plugin.attributes = kAttributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  // Of those that lead, but tables that tell so may not be filled yet.
  plugin.nstate = [](const mjModel* m, int instance) { return Leads(m, instance) ? StateSize(m) : 0; };
  plugin.init = Init;
  plugin.destroy = [](mjData* d, int instance) {
    (void)instance;
    All().Set(d, nullptr);
  };
  plugin.copy = [](mjData* to, const mjModel*, const mjData* from, int instance) {
    (void)instance;
    Workspace *into = All().Find(to), *out_of = All().Find(from);
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

#ifdef _WIN32
#define SGM_EXPORT extern "C" __declspec(dllexport)
#else
#define SGM_EXPORT extern "C" __attribute__((visibility("default")))
#endif

// Copies the contacts between geoms and flexes in the last step, `capacity` at most, with vertices as in mjModel.
// Returns how many there are.
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

// Mean force [N] of the last step with which its flex pulled a vertex of the model that is held. It is in the state.
SGM_EXPORT double softgym_mj_cloth_holding_force(const mjModel* m, mjData* d, int vertex) {
  using namespace softgym_mj::cloth;
  int instance;
  const Workspace* w = FindWorkspace(m, d, &instance);
  if (!w || d->plugin_state[m->plugin_stateadr[instance]] != 1) return 0;
  for (size_t p = 0; p < w->flexes.size(); ++p) {
    const int first = m->flex_vertadr[w->flexes[p]];
    if (vertex < first || vertex >= first + m->flex_vertnum[w->flexes[p]]) continue;
    return StateOf(m, d, instance, *w).holding_force[w->mesh.first[p] + vertex - first];
  }
  return 0;
}
