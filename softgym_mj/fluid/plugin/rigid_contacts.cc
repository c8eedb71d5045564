#include "rigid_contacts.h"

#include <algorithm>

#include "native/pose.h"

namespace softgym_mj {

// The index of a body in the list; enters it with its inverse inertia.
int RigidContacts::FindBody(const mjModel* m, const mjData* d, int id) {
  for (size_t i = 0; i < ids_.size(); ++i) {
    if (ids_[i] == id) return static_cast<int>(i);
  }
  const int index = static_cast<int>(ids_.size()), nv = m->nv;
  ids_.push_back(id);
  jacobian_.resize(6 * nv);
  response_.resize(6 * nv * (index + 1));
  mjtNum *jacobian = jacobian_.data(), *response = response_.data() + 6 * nv * index;
  mj_jac(m, d, jacobian, jacobian + 3 * nv, d->xipos + 3 * id, id);
  mj_solveM(m, const_cast<mjData*>(d), response, jacobian, 6);
  Body body = {};
  mjtNum twist[6];
  mju_mulMatVec(twist, jacobian, d->qvel, 6, nv);
  mju_scl(twist, twist, m->opt.timestep, 6);
  body.move = FromArray(twist);
  body.turn = FromArray(twist + 3);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      body.compliance[i][j] = mju_dot(jacobian + i * nv, response + j * nv, nv);
    }
  }
  bodies.push_back(body);
  return index;
}

void RigidContacts::Find(const mjModel* m, const mjData* d, const Mesh& mesh,
                         const std::vector<Vector>& start) {
  const mjtNum dt = m->opt.timestep;
  contacts.clear();
  ids_.clear();
  bodies.clear();
  for (int c = 0; c < d->ncon; ++c) {
    const mjContact& contact = d->contact[c];
    const int side = contact.flex[1] >= 0 ? 1 : 0;
    if (contact.flex[side] < 0 || contact.geom[1 - side] < 0) continue;
    const auto found =
        std::find(mesh.flexes.begin(), mesh.flexes.end(), contact.flex[side]);
    if (found == mesh.flexes.end()) continue;
    const int flex = *found, first = mesh.first[found - mesh.flexes.begin()];
    RigidContact rigid = {};
    const Vector normal = FromArray(contact.frame), position = FromArray(contact.pos);
    rigid.normal = (side ? 1.0 : -1.0) * normal;
    rigid.friction = contact.dim > 1 ? contact.friction[0] : 0;
    rigid.gap = std::max(0.0, contact.dist);
    rigid.solved = contact.efc_address >= 0;
    if (rigid.solved && (contact.dim == 1 || m->opt.cone == mjCONE_ELLIPTIC)) {
      // The engine's soft contact: acceleration >= reference - softness * force, which may still change.
      const int row = contact.efc_address;
      rigid.softness = d->efc_R[row];
      rigid.impulse = dt * dt * d->efc_force[row];
      const mjtNum acceleration = d->efc_aref[row] - d->efc_R[row] * d->efc_force[row];
      rigid.gap = -dt * (d->efc_vel[row] + dt * acceleration);
    }
    rigid.body = -1;
    if (contact.vert[side] >= 0) {
      for (int& v : rigid.vertex) v = first + contact.vert[side];
      rigid.weight[0] = 1;
    } else {
      // As the engine weighs the corners of an element.
      const int dim = m->flex_dim[flex];
      const int* corner =
          m->flex_elem + m->flex_elemdataadr[flex] + contact.elem[side] * (dim + 1);
      double sum = 0;
      for (int k = 0; k < 3; ++k) {
        const int v = first + corner[std::min(k, dim)];
        rigid.vertex[k] = v;
        if (k > dim) continue;
        rigid.weight[k] = 1 / std::max(1e-9, Norm(position - start[v]));
        sum += rigid.weight[k];
      }
      for (double& weight : rigid.weight) weight /= sum;
    }
    const int body = m->geom_bodyid[contact.geom[1 - side]];
    if (IsDynamic(m, body)) {
      rigid.body = FindBody(m, d, body);
      rigid.position = position - FromArray(d->xipos + 3 * body);
    }
    contacts.push_back(rigid);
  }
}

void RigidContacts::Apply(const mjModel* m, mjData* d, const std::vector<Body>& positions) {
  if (bodies.empty()) return;
  const int nv = m->nv;
  change_.assign(nv, 0);
  for (size_t i = 0; i < bodies.size(); ++i) {
    const mjtNum* response = response_.data() + 6 * nv * i;
    for (int k = 0; k < 6; ++k) {
      mju_addToScl(d->qvel, response + k * nv, bodies[i].wrench[k] / m->opt.timestep, nv);
      mju_addToScl(change_.data(), response + k * nv, positions[i].wrench[k], nv);
    }
  }
  mj_integratePos(m, d->qpos, change_.data(), 1);
}

}  // namespace softgym_mj
