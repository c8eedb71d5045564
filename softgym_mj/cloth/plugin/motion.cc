#include "cloth/plugin/motion.h"

#include <algorithm>
#include <cmath>

#include "native/pose.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

// [kg] A vertex that counts as heavier in mjModel.dof_M0 is held: it keeps the velocity that it is given.
constexpr double kHeldMass = 1;

// Pose of a body at the start of the step, from mjData.
Pose StartPose(const mjData* d, int body) {
  Pose pose;
  mju_copy3(pose.position, d->xpos + 3 * body);
  mju_copy4(pose.quaternion, d->xquat + 4 * body);
  return pose;
}

}  // namespace

bool Gather(const mjModel* m, const mjData* d, Workspace* w) {
  const int count = w->mesh.NumVertices();
  const double dt = m->opt.timestep;
  Start& start = w->start;
  for (auto* a : {&start.position, &start.velocity, &start.acceleration}) a->assign(3 * count, 0);
  start.inverse_mass.assign(count, 0);
  start.yielding.assign(count, 0);
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
      start.yielding[v] = start.inverse_mass[v];
      if (held) start.yielding[v] = static_cast<float>(1 / w->mesh.mass[v]);
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
    w->start.inverse_mass[v] = w->start.yielding[v] = 0;
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
    PlaneContact plane = {};
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

}  // namespace softgym_mj::cloth
