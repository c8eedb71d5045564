#include "flex.h"

#include <cmath>

#include "pose.h"
#include "reset.h"

namespace softgym_mj {
namespace {

// Pose of a body with three slides, given that of its parent: the result of BodyPose without traversing the tree for
// every vertex.
Pose SlidPose(const mjModel* m, const mjData* d, int body, const Pose& parent) {
  mjtNum slid[3] = {0, 0, 0}, local[3];
  for (int j = m->body_jntadr[body]; j < m->body_jntadr[body] + 3; ++j) {
    const int q = m->jnt_qposadr[j];
    mju_addToScl3(slid, m->jnt_axis + 3 * j, d->qpos[q] - m->qpos0[q]);
  }
  mju_rotVecQuat(local, slid, m->body_quat + 4 * body);
  mju_addTo3(local, m->body_pos + 3 * body);
  Pose pose;
  mju_rotVecQuat(pose.position, local, parent.quaternion);
  mju_addTo3(pose.position, parent.position);
  mju_mulQuat(pose.quaternion, parent.quaternion, m->body_quat + 4 * body);
  return pose;
}

// Largest inner product of axes that count as orthogonal.
constexpr mjtNum kSquare = 1e-6;

}  // namespace

bool OnSlides(const mjModel* m, int body) {
  if (m->body_jntnum[body] != 3 || m->body_mocapid[body] >= 0) return false;
  const int joint = m->body_jntadr[body];
  for (int j = 0; j < 3; ++j) {
    if (m->jnt_type[joint + j] != mjJNT_SLIDE) return false;
    const mjtNum *axis = m->jnt_axis + 3 * (joint + j), *next = m->jnt_axis + 3 * (joint + (j + 1) % 3);
    if (std::abs(mju_dot3(axis, next)) > kSquare) return false;
  }
  return true;
}

std::string CollectFlexes(const mjModel* m, std::vector<FlexElement>* elements) {
  elements->clear();
  for (int f = 0; f < m->nflex; ++f) {
    if (m->flex_dim[f] > 2 || m->flex_interp[f]) {
      const char* name = mj_id2name(m, mjOBJ_FLEX, f);
      return "flex " + (name && *name ? "\"" + std::string(name) + "\"" : std::to_string(f)) +
             " cannot hold the fluid back: with flexes=\"true\" expected all of dimension 1 or 2 "
             "with vertices, dof=\"full\".";
    }
    const int dim = m->flex_dim[f], first = m->flex_vertadr[f];
    const int* corner = m->flex_elem + m->flex_elemdataadr[f];
    for (int e = 0; e < m->flex_elemnum[f]; ++e, corner += dim + 1) {
      elements->push_back({{first + corner[0], first + corner[1], first + corner[dim]}, dim == 2, m->flex_radius[f]});
    }
  }
  return "";
}

bool FindVertices(const mjModel* m, const mjData* d, std::vector<mjtNum>* positions) {
  positions->resize(3 * m->nflexvert);
  int last_parent = -1, last_body = -1;
  Pose parent = {}, pose = {};
  for (int f = 0; f < m->nflex; ++f) {
    for (int v = m->flex_vertadr[f]; v < m->flex_vertadr[f] + m->flex_vertnum[f]; ++v) {
      const int body = m->flex_vertbodyid[v];
      if (body != last_body) {
        last_body = body;
        if (!OnSlides(m, body)) {
          pose = BodyPose(m, d, body);
        } else {
          if (m->body_parentid[body] != last_parent) {
            last_parent = m->body_parentid[body];
            parent = BodyPose(m, d, last_parent);
          }
          pose = SlidPose(m, d, body, parent);
        }
      }
      mjtNum* position = positions->data() + 3 * v;
      mju_copy3(position, pose.position);
      if (!m->flex_centered[f]) {
        mjtNum offset[3];
        mju_rotVecQuat(offset, m->flex_vert + 3 * v, pose.quaternion);
        mju_addTo3(position, offset);
      }
    }
  }
  return AreSane(positions->data(), static_cast<int>(positions->size()));
}

}  // namespace softgym_mj
