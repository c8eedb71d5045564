#include "cloth/plugin/motion.h"

#include <algorithm>
#include <cmath>

#include "native/pose.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

// [kg] A vertex whose mass in mjModel.dof_M0 exceeds its own by this much is held: it keeps its given velocity.
constexpr double kHeldMass = 1;

// Pose of a body at the start of the step, from mjData.
Pose StartPose(const mjData* d, int body) {
  Pose pose;
  mju_copy3(pose.position, d->xpos + 3 * body);
  mju_copy4(pose.quaternion, d->xquat + 4 * body);
  return pose;
}

// Transforms a point to the frame of a body.
void Localize(const Pose& pose, const mjtNum* point, mjtNum* local) {
  mjtNum back[4];
  mju_sub3(local, point, pose.position);
  mju_negQuat(back, pose.quaternion);
  mju_rotVecQuat(local, local, back);
}

// Velocity at the start of the step of a point of a body.
void PointVelocity(const mjModel* m, const mjData* d, int body, const mjtNum* point, mjtNum* out) {
  const mjtNum* velocity = d->cvel + 6 * body;  // Rotation, then translation of the tree's center of mass.
  mjtNum offset[3];
  mju_sub3(offset, point, d->subtree_com + 3 * m->body_rootid[body]);
  mju_cross(out, velocity, offset);
  mju_addTo3(out, velocity + 3);
}

// The two sides of an equality constraint: bodies and constrained points.
struct Ends {
  int body[2];
  mjtNum point[2][3];
};
bool FindEnds(const mjModel* m, const mjData* d, int equality, Ends* ends) {
  const bool welds = m->eq_type[equality] == mjEQ_WELD;
  if (!(welds || m->eq_type[equality] == mjEQ_CONNECT) || !d->eq_active[equality]) return false;
  for (int side = 0; side < 2; ++side) {
    const int id = side ? m->eq_obj2id[equality] : m->eq_obj1id[equality];
    if (m->eq_objtype[equality] == mjOBJ_SITE) {
      ends->body[side] = m->site_bodyid[id];
      mju_copy3(ends->point[side], d->site_xpos + 3 * id);
    } else {
      ends->body[side] = id;
      const mjtNum* local = m->eq_data + mjNEQDATA * equality + 3 * (welds ? 1 - side : side);
      mju_mulMatVec3(ends->point[side], d->xmat + 9 * id, local);
      mju_addTo3(ends->point[side], d->xpos + 3 * id);
    }
  }
  return true;
}

// Writes the motion of a vertex whose slides are in the world frame.
void ApplyTo(int v, mjData* d, const Workspace& w) {
  const Vector move = FromArray(&w.motion.move[3 * v]), velocity = FromArray(&w.motion.velocity[3 * v]);
  for (int k = 0; k < 3; ++k) {
    const Vector axis = FromArray(&w.axes[9 * v + 3 * k]);
    d->qvel[w.vertices[v].dof + k] = Dot(axis, velocity);
    d->qpos[w.vertices[v].qpos + k] = w.qpos[w.vertices[v].qpos + k] + Dot(axis, move);
  }
}

}  // namespace

bool Gather(const mjModel* m, const mjData* d, Workspace* w) {
  const int count = w->mesh.NumVertices();
  const double dt = m->opt.timestep;
  Start& start = w->start;
  for (auto* a : {&start.position, &start.velocity, &start.acceleration}) a->assign(3 * count, 0);
  start.inverse_mass.assign(count, 0);
  start.yielding.assign(count, 0);
  start.ties.clear();
  start.rides.assign(count, false);
  w->axes.resize(9 * count);
  w->local.resize(3 * count);
  double sum = 0;
  for (int v = 0; v < count; ++v) {
    const int part = w->mesh.part[v], flex = w->mesh.flexes[part];
    const int address = m->flex_vertadr[flex] + v - w->mesh.first[part];
    const Vertex& vertex = w->vertices[v];
    mju_copy3(&start.position[3 * v], d->flexvert_xpos + 3 * address);
    if (vertex.dof < 0) {
      // Its parent body carries it from the pose at the start to that at the end.
      const Pose pose = BodyPose(m, d, vertex.body);
      mjtNum end[3];
      mju_rotVecQuat(end, m->flex_vert + 3 * address, pose.quaternion);
      mju_addTo3(end, pose.position);
      for (int k = 0; k < 3; ++k) start.velocity[3 * v + k] = (end[k] - start.position[3 * v + k]) / dt;
      Tie tie = {v, vertex.body, {}, 0, false};
      mju_copy3(tie.point, &start.position[3 * v]);
      if (m->body_treeid[vertex.body] >= 0) start.ties.push_back(tie);
    } else {
      const int body = vertex.body, joint = m->body_jntadr[body];
      const int parent = m->body_parentid[body];
      const Pose from = StartPose(d, parent);
      const double mass = m->dof_M0[vertex.dof];
      const bool held = mass > kHeldMass + m->body_mass[body];
      if (vertex.carried) {
        const Pose to = BodyPose(m, d, parent);
        mjtNum local[3], *carried = &start.velocity[3 * v];
        Localize(from, &start.position[3 * v], local);
        if (held) {
          // Motion of the parent in the step.
          mju_rotVecQuat(carried, local, to.quaternion);
          mju_addTo3(carried, to.position);
          mju_subFrom3(carried, &start.position[3 * v]);
          mju_scl3(carried, carried, 1 / dt);
        } else {
          PointVelocity(m, d, parent, &start.position[3 * v], carried);
          mjtNum acceleration[6];
          PointAcceleration(m, d, body, &start.position[3 * v], w->qvel.data(), d->qvel, acceleration);
          mju_copy3(&start.acceleration[3 * v], acceleration);
        }
        mju_copy3(&w->local[3 * v], local);
      }
      mjtNum quaternion[4];
      mju_mulQuat(quaternion, from.quaternion, m->body_quat + 4 * body);
      // MuJoCo solves the damping of slides implicitly, which acts like added mass.
      start.inverse_mass[v] = held ? 0 : static_cast<float>(1 / (mass + dt * m->dof_damping[vertex.dof]));
      start.yielding[v] = start.inverse_mass[v];
      if (held) start.yielding[v] = static_cast<float>(1 / w->mesh.mass[v]);
      for (int k = 0; k < 3; ++k) {
        mjtNum* axis = &w->axes[9 * v + 3 * k];
        mju_rotVecQuat(axis, m->jnt_axis + 3 * (joint + k), quaternion);
        const double before = w->qvel[vertex.dof + k], after = d->qvel[vertex.dof + k];
        mju_addToScl3(&start.velocity[3 * v], axis, before);
        if (!held && !vertex.carried) mju_addToScl3(&start.acceleration[3 * v], axis, (after - before) / dt);
      }
    }
    for (int k = 0; k < 3; ++k)
      sum += start.position[3 * v + k] + start.velocity[3 * v + k] + start.acceleration[3 * v + k];
  }
  return std::isfinite(sum);
}

void HoldTied(const mjModel* m, const mjData* d, Workspace* w) {
  Start& start = w->start;
  std::vector<bool> fixed(w->vertices.size());
  for (int e = 0; e < m->neq; ++e) {
    Ends ends;
    if (!FindEnds(m, d, e, &ends)) continue;
    int found[2] = {-1, -1};
    for (size_t v = 0; v < w->vertices.size(); ++v) {
      for (int side = 0; side < 2; ++side) {
        if (w->vertices[v].dof >= 0 && w->vertices[v].body == ends.body[side]) found[side] = static_cast<int>(v);
      }
    }
    if ((found[0] < 0) == (found[1] < 0)) continue;  // Neither side is a vertex, or both are.
    const int side = found[0] < 0, v = found[side], body = ends.body[1 - side];
    if (start.inverse_mass[v] > 0) {
      for (int k = 0; k < 3; ++k) {
        start.velocity[3 * v + k] += m->opt.timestep * start.acceleration[3 * v + k];
        start.acceleration[3 * v + k] = 0;
      }
    }
    start.inverse_mass[v] = start.yielding[v] = 0;
    if (m->body_treeid[body] < 0) {
      fixed[v] = true;
    } else {
      const double torque = m->eq_data[mjNEQDATA * e + 10];
      Tie tie = {v, body, {}, m->body_mass[w->vertices[v].body], m->eq_type[e] == mjEQ_WELD && torque > 0};
      mju_copy3(tie.point, ends.point[1 - side]);
      start.ties.push_back(tie);
    }
  }
  // A vertex that is also tied to a fixed body follows MuJoCo; of two moving bodies the first one leads.
  std::vector<Tie> ties;
  for (const Tie& tie : start.ties) {
    if (!fixed[tie.vertex]) ties.push_back(tie);
    fixed[tie.vertex] = true;
  }
  start.ties = ties;
}

void FindPlanes(const mjModel* m, const mjData* d, Workspace* w) {
  w->planes.clear();
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_type[g] != mjGEOM_PLANE) continue;
    PlaneContact plane = {};
    for (int k = 0; k < 3; ++k) {
      plane.point[k] = d->geom_xpos[3 * g + k];
      plane.normal[k] = d->geom_xmat[9 * g + 3 * k + 2];
    }
    bool touches = false;
    for (size_t p = 0; p < w->mesh.flexes.size(); ++p) {
      plane.touches.push_back(MayTouch(m, g, w->mesh.materials[p]));
      plane.friction.push_back(static_cast<float>(Friction(m, g, w->mesh.flexes[p])));
      touches |= plane.touches.back();
    }
    if (touches) w->planes.push_back(plane);
  }
}

void Apply(mjData* d, const Workspace& w) {
  for (int v = 0; v < w.mesh.NumVertices(); ++v) {
    if (w.vertices[v].dof >= 0 && !w.vertices[v].carried) ApplyTo(v, d, w);
  }
}

void ApplyToLed(const mjModel* m, mjData* d, const Workspace& w) {
  int last = -1;
  Pose pose = {};
  Twist twist = {};
  for (int v = 0; v < w.mesh.NumVertices(); ++v) {
    const Vertex& vertex = w.vertices[v];
    if (!vertex.carried && w.start.rides[v] && vertex.dof >= 0) ApplyTo(v, d, w);
    if (!vertex.carried) continue;
    const int parent = m->body_parentid[vertex.body];
    if (parent != last) pose = BodyPose(m, d, parent, &twist);
    last = parent;
    mjtNum point[3], local[3], carried[3], velocity[3], back[4];
    mju_add3(point, &w.start.position[3 * v], &w.motion.move[3 * v]);
    Localize(pose, point, local);
    mju_subFrom3(local, &w.local[3 * v]);
    mju_cross(carried, twist.angular, point);
    mju_addTo3(carried, twist.linear);
    mju_sub3(velocity, &w.motion.velocity[3 * v], carried);
    mju_negQuat(back, pose.quaternion);
    mju_rotVecQuat(velocity, velocity, back);
    for (int k = 0; k < 3; ++k) {
      mjtNum axis[3];
      mju_rotVecQuat(axis, m->jnt_axis + 3 * (m->body_jntadr[vertex.body] + k), m->body_quat + 4 * vertex.body);
      d->qvel[vertex.dof + k] = mju_dot3(axis, velocity);
      d->qpos[vertex.qpos + k] = w.qpos[vertex.qpos + k] + mju_dot3(axis, local);
    }
  }
}

}  // namespace softgym_mj::cloth
