#include "cloth_contact.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <mujoco/mjplugin.h>

#include "native/attributes.h"
#include "contact_solver.h"
#include "impact.h"
#include "native/reset.h"
#include "native/pose.h"
#include "rigid_contacts.h"

namespace softgym_mj {
namespace {

constexpr const char* kAttributes[] = {"iterations", "stretch", "compression", "friction"};

// Where a vertex is in the model.
struct Vertex {
  int body;
  int dof, qpos;  // Of its three slides; -1 if something else moves it.
};

constexpr int kMaxSearches = 4;  // For pairs that may pass through each other after all.

// What a thread needs for a step. Only memory, the parsed attributes, the mesh and the candidate pairs
// outlive a call; each is checked against the model and the positions, so nothing depends on which thread,
// model or mjData came before. Addresses in the model are looked up in every step.
struct Workspace {
  std::string attributes, signature, scratch;
  ContactConfig config;
  std::vector<int> flexes;
  Mesh mesh;
  std::vector<Vertex> vertices;
  std::vector<mjtNum> axes;  // World directions of the slides of each vertex (n, 3, 3).
  Proximity proximity;
  std::vector<Pair> pairs;
  RigidContacts rigid;
  std::vector<Body> position_bodies;
  Motion motion;
  std::vector<float> before, other_move;
  ContactSolver solver;
};

Workspace& ThreadWorkspace() {
  thread_local Workspace workspace;
  return workspace;
}

std::string FlexName(const mjModel* m, int flex) {
  const char* name = mj_id2name(m, mjOBJ_FLEX, flex);
  return "flex " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(flex));
}

// The flexes whose vertices carry the instance. "" or what is wrong.
std::string CollectFlexes(const mjModel* m, int instance, std::vector<int>* flexes) {
  flexes->clear();
  for (int f = 0; f < m->nflex; ++f) {
    const int* body = m->flex_vertbodyid + m->flex_vertadr[f];
    const bool carries = std::any_of(body, body + m->flex_vertnum[f],
                                     [&](int b) { return m->body_plugin[b] == instance; });
    if (!carries) continue;
    if (m->flex_dim[f] > 2 || m->flex_interp[f] || m->flex_rigid[f]) {
      return FlexName(m, f) + " cannot be handled: expected a deformable one of dimension 1 or 2 "
                              "with vertices, dof=\"full\".";
    }
    if (m->flex_selfcollide[f] != mjFLEXSELF_NONE) {
      return FlexName(m, f) + " would collide with itself twice: expected selfcollide=\"none\".";
    }
    flexes->push_back(f);
  }
  if (flexes->empty()) {
    return "no flex carries it: expected <plugin instance=\"...\"/> inside a flexcomp.";
  }
  for (int f : *flexes) {
    for (int g : *flexes) {
      if (f < g && ((m->flex_contype[f] & m->flex_conaffinity[g]) ||
                    (m->flex_contype[g] & m->flex_conaffinity[f]))) {
        return FlexName(m, f) + " and " + FlexName(m, g) +
               " would collide twice: expected contype and conaffinity with no bit in common.";
      }
    }
  }
  return "";
}

std::string ParseConfig(const mjModel* m, int instance, ContactConfig* config) {
  ContactConfig parsed;
  AttributeReader read(m, instance);
  read.Numbers("iterations", &parsed.iterations, 1, 1, 1000);
  read.Numbers("stretch", &parsed.stretch, 1, 0.01, 10);
  read.Numbers("compression", &parsed.compression, 1, 0.01, 1);
  read.Numbers("friction", &parsed.friction, 1, 0, 10);
  if (read.error().empty()) *config = parsed;
  return read.error();
}

Vertex FindVertex(const mjModel* m, int body) {
  const int joint = m->body_jntadr[body];
  bool slides = m->body_jntnum[body] == 3;
  for (int j = joint; slides && j < joint + 3; ++j) slides = m->jnt_type[j] == mjJNT_SLIDE;
  if (!slides) return {body, -1, -1};
  return {body, m->body_dofadr[body], m->jnt_qposadr[joint]};
}

// Parses the attributes and finds the flexes. "" or what is wrong.
std::string Check(const mjModel* m, int instance, Workspace* w, std::vector<int>* flexes) {
  std::string error, attributes = RawAttributes(m, instance);
  if (attributes != w->attributes || w->attributes.empty()) {
    error = ParseConfig(m, instance, &w->config);
    w->attributes = error.empty() ? attributes : "";
  }
  if (error.empty()) error = CollectFlexes(m, instance, flexes);
  if (error.empty() && m->opt.integrator == mjINT_RK4) {
    error = "integrator RK4 is not supported: expected Euler, implicit, implicitfast or discrete.";
  }
  if (error.empty() && (m->opt.enableflags & mjENBL_SLEEP)) {
    error = "the flag sleep is not supported.";
  }
  return error;
}

// The workspace for an instance. Null, with the reason, if the model was changed after it was compiled to
// what cannot be handled.
Workspace* Open(const mjModel* m, int instance, char* reason) {
  Workspace& w = ThreadWorkspace();
  const std::string error = Check(m, instance, &w, &w.flexes);
  std::snprintf(reason, kReasonSize, "%s", error.c_str());
  if (!error.empty()) return nullptr;
  WriteSignature(m, w.flexes, &w.scratch);
  if (w.scratch != w.signature) {
    w.signature = w.scratch;
    w.mesh = MakeMesh(m, w.flexes);
    w.proximity.Reset(w.mesh);
  }
  w.vertices.clear();
  for (int f : w.flexes) {
    const int* body = m->flex_vertbodyid + m->flex_vertadr[f];
    for (int i = 0; i < m->flex_vertnum[f]; ++i) w.vertices.push_back(FindVertex(m, body[i]));
  }
  return &w;
}

// Fills the motion; false if something is not finite.
bool Gather(const mjModel* m, const mjData* d, Workspace* w) {
  const int count = w->mesh.NumVertices();
  Motion& motion = w->motion;
  motion.start.resize(count);
  motion.move.assign(4 * (count + 1), 0);  // One more, which does not move, fills rows.
  w->axes.resize(9 * count);
  int last_parent = -1;
  Pose parent = {};
  double sum = 0;
  for (int v = 0; v < count; ++v) {
    const int part = w->mesh.part[v], flex = w->mesh.flexes[part];
    const int address = m->flex_vertadr[flex] + v - w->mesh.first[part];
    const Vertex& vertex = w->vertices[v];
    const mjtNum* start = d->flexvert_xpos + 3 * address;
    mjtNum end[3], local[3] = {0, 0, 0};
    if (vertex.dof < 0) {
      const Pose pose = BodyPose(m, d, vertex.body);
      mju_rotVecQuat(end, m->flex_vert + 3 * address, pose.quaternion);
      mju_addTo3(end, pose.position);
      motion.move[4 * v + 3] = 0;
    } else {
      const int body = vertex.body, joint = m->body_jntadr[body];
      if (m->body_parentid[body] != last_parent) {
        last_parent = m->body_parentid[body];
        parent = BodyPose(m, d, last_parent);
      }
      mjtNum quaternion[4], offset[3];
      mju_mulQuat(quaternion, parent.quaternion, m->body_quat + 4 * body);
      mju_rotVecQuat(end, m->body_pos + 3 * body, parent.quaternion);
      mju_addTo3(end, parent.position);
      for (int k = 0; k < 3; ++k) {
        mjtNum* axis = &w->axes[9 * v + 3 * k];
        mju_rotVecQuat(axis, m->jnt_axis + 3 * (joint + k), quaternion);
        const int q = vertex.qpos + k;
        mju_addToScl3(end, axis, d->qpos[q] - m->qpos0[q]);
      }
      if (!m->flex_centered[flex]) {
        mju_copy3(local, m->flex_vert + 3 * address);
        mju_rotVecQuat(offset, local, quaternion);
        mju_addTo3(end, offset);
      }
      motion.move[4 * v + 3] = static_cast<float>(1 / m->dof_M0[vertex.dof]);
    }
    motion.start[v] = FromArray(start);
    for (int k = 0; k < 3; ++k) {
      motion.move[4 * v + k] = static_cast<float>(end[k] - start[k]);
      sum += end[k] + start[k];
    }
  }
  return std::isfinite(sum);
}

// Gives vertices that an equality ties to something else an infinite mass: it holds them, contact must not.
void HoldVertices(const mjModel* m, const mjData* d, Workspace* w) {
  for (int e = 0; e < m->neq; ++e) {
    const bool ties = m->eq_type[e] == mjEQ_CONNECT || m->eq_type[e] == mjEQ_WELD;
    if (!ties || !d->eq_active[e] || m->eq_objtype[e] != mjOBJ_BODY) continue;
    int found[2] = {-1, -1};
    for (size_t v = 0; v < w->vertices.size(); ++v) {
      if (w->vertices[v].body == m->eq_obj1id[e]) found[0] = static_cast<int>(v);
      if (w->vertices[v].body == m->eq_obj2id[e]) found[1] = static_cast<int>(v);
    }
    if ((found[0] < 0) == (found[1] < 0)) continue;  // Neither, or two that are sewn together.
    w->motion.move[4 * std::max(found[0], found[1]) + 3] = 0;
  }
}

// Writes what has changed of the vertices to qvel and qpos.
void Apply(const mjModel* m, mjData* d, Workspace* w, const std::vector<float>& velocity) {
  const double dt = m->opt.timestep;
  const int count = w->mesh.NumVertices();
  for (int v = 0; v < count; ++v) {
    if (w->vertices[v].dof < 0) continue;
    const float *a = &velocity[4 * v], *b = &w->motion.move[4 * v], *c = &w->before[4 * v];
    const Vector dv = {(a[0] - c[0]) / dt, (a[1] - c[1]) / dt, (a[2] - c[2]) / dt};
    const Vector dx = {b[0] - c[0], b[1] - c[1], b[2] - c[2]};
    for (int k = 0; k < 3; ++k) {
      const Vector axis = FromArray(&w->axes[9 * v + 3 * k]);
      d->qvel[w->vertices[v].dof + k] += Dot(axis, dv);
      d->qpos[w->vertices[v].qpos + k] += Dot(axis, dx);
    }
  }
}

// The compiler makes an mjData of every model, so what is wrong is found there.
int Init(const mjModel* m, mjData* d, int instance) {
  char reason[kReasonSize];
  if (!Open(m, instance, reason) && !IsRestarting()) Fail(m, instance, reason);
  d->plugin_data[instance] = 0;
  return 0;
}

void Advance(const mjModel* m, mjData* d, int instance) {
  if (m->opt.disableflags & mjDSBL_CONTACT) return;
  char reason[kReasonSize];
  Workspace* opened = Open(m, instance, reason);
  if (!opened) {
    Warn(m, d, instance, reason);
    return;
  }
  Workspace& w = *opened;
  if (!Gather(m, d, &w)) return;  // MuJoCo finds what is not finite and resets in the next step.
  HoldVertices(m, d, &w);
  w.proximity.Find(w.mesh, w.motion, &w.pairs);
  w.rigid.Find(m, d, w.mesh, w.motion.start);
  w.before = w.motion.move;
  w.solver.Solve(w.config, m->opt.timestep, w.mesh, w.pairs, w.rigid.contacts, &w.motion,
                 &w.rigid.bodies, &w.other_move, &w.position_bodies);
  std::swap(w.motion.move, w.other_move);  // From here on the motion is that of the positions.
  std::vector<float>& velocity = w.other_move;
  PreventImpacts(w.pairs, &w.motion, &velocity);
  // Pairs that were not of interest may be by now.
  for (int i = 0; i < kMaxSearches && !w.proximity.Vouches(w.mesh, w.motion, w.before); ++i) {
    w.proximity.Find(w.mesh, w.motion, &w.pairs);
    if (!PreventImpacts(w.pairs, &w.motion, &velocity)) break;
  }
  Apply(m, d, &w, velocity);
  w.rigid.Apply(m, d, w.position_bodies);
}

}  // namespace

void RegisterClothContact() {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "softgym_mj.cloth_contact";
  plugin.nattribute = sizeof(kAttributes) / sizeof(kAttributes[0]);
  plugin.attributes = kAttributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = [](const mjModel*, int) { return 0; };
  plugin.init = Init;
  plugin.compute = [](const mjModel*, mjData*, int, int) {};
  plugin.advance = Advance;
  mjp_registerPlugin(&plugin);
}

}  // namespace softgym_mj
