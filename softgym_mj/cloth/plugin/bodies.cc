#include "cloth/plugin/bodies.h"

#include <algorithm>
#include <cmath>

#include "cloth/plugin/method.h"
#include "native/flex.h"
#include "native/pose.h"

namespace softgym_mj::cloth {
namespace {

// Factor on the rotational inertia of a body whose rotation a weld locks: MuJoCo solves the weld, which is to a vertex.
constexpr double kLocked = 1e4;

// Inertia that an implicit integrator adds to M for a degree of freedom: dt D + dt^2 K of damping and servos.
double ServoInertia(const mjModel* m, const mjData* d, int dof) {
  const double dt = m->opt.timestep;
  double damping = m->dof_damping[dof], stiffness = 0;
  for (int a = 0; a < m->nu; ++a) {
    if (m->actuator_trntype[a] != mjTRN_JOINT || m->jnt_dofadr[m->actuator_trnid[2 * a]] != dof) continue;
    if (m->actuator_biastype[a] != mjBIAS_AFFINE) continue;
    const double *range = m->actuator_forcerange + 2 * a, force = d->actuator_force[a];
    if (m->actuator_forcelimited[a] && (force <= range[0] || force >= range[1])) continue;
    const double gear = m->actuator_gear[6 * a], *bias = m->actuator_biasprm + mjNBIAS * a;
    damping -= gear * gear * bias[2];
    stiffness -= gear * gear * bias[1];
  }
  const bool implicit = m->opt.integrator != mjINT_EULER;
  return dt * std::max(damping, 0.0) + (implicit ? dt * dt * std::max(stiffness, 0.0) : 0);
}

// Computes the lower Cholesky factor (n, n) in place.
void Factor(std::vector<double>* a, int n) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = (*a)[n * i + j];
      for (int k = 0; k < j; ++k) sum -= (*a)[n * i + k] * (*a)[n * j + k];
      (*a)[n * i + j] = i == j ? std::sqrt(std::max(sum, 1e-12)) : sum / (*a)[n * j + j];
    }
  }
}

void SolveFactored(const std::vector<double>& l, int n, double* x) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= l[n * i + k] * x[k];
    x[i] /= l[n * i + i];
  }
  for (int i = n; i-- > 0;) {
    for (int k = i + 1; k < n; ++k) x[i] -= l[n * k + i] * x[k];
    x[i] /= l[n * i + i];
  }
}

// Whether a body is only a vertex that slides in a body of the same tree.
bool IsSlidingVertex(const mjModel* m, int body) {
  return OnSlides(m, body) && m->body_treeid[m->body_parentid[body]] >= 0 && m->body_geomnum[body] == 0 &&
         m->body_subtreemass[body] == m->body_mass[body];
}

}  // namespace

double PointCompliance(const double c[6][6], const double arm[3]) {
  // `along`: Jacobian of a point with respect to the motion of its body.
  const double along[3][6] = {
      {1, 0, 0, 0, arm[2], -arm[1]}, {0, 1, 0, -arm[2], 0, arm[0]}, {0, 0, 1, arm[1], -arm[0], 0}};
  double largest = 0;
  for (const auto& row : along) {
    double sum = 0;
    for (const auto& column : along) {
      double entry = 0;
      for (int k = 0; k < 6; ++k) {
        for (int l = 0; l < 6; ++l) entry += row[k] * c[k][l] * column[l];
      }
      sum += std::abs(entry);
    }
    largest = std::max(largest, sum);
  }
  return largest;
}

void Bodies::Start(const mjModel* m, const mjData* d, const mjtNum* qvel, const std::vector<Tie>& ties, double h) {
  m_ = m, d_ = d, qvel_ = qvel, ties_ = &ties, h_ = h;
  trees_.clear();
  bodies_.clear();
  of_body_.assign(m->nbody, -1);
}

int Bodies::FindTree(int id) {
  for (size_t t = 0; t < trees_.size(); ++t) {
    if (trees_[t].id == id) return static_cast<int>(t);
  }
  Tree tree = {id, m_->tree_dofadr[id], 0, {}, {}, {}, {}};
  tree.place.assign(m_->tree_dofnum[id], 0);
  for (int v = 0; v < m_->nflexvert; ++v) {
    const int body = m_->flex_vertbodyid[v];
    const auto to_it = [&](const Tie& tie) { return tie.body == body; };
    if (m_->body_treeid[body] != id || !IsSlidingVertex(m_, body)) continue;
    if (std::any_of(ties_->begin(), ties_->end(), to_it)) continue;
    for (int k = 0; k < 3; ++k) tree.place[m_->body_dofadr[body] + k - tree.first] = -1;
  }
  for (size_t i = 0; i < tree.place.size(); ++i) {
    if (tree.place[i] < 0) continue;
    tree.place[i] = tree.count++;
    tree.dofs.push_back(tree.first + static_cast<int>(i));
  }
  const int n = tree.count;
  tree.factor.assign(n * n, 0);
  tree.acceleration.resize(n);
  for (int i = 0; i < n; ++i) {
    const int dof = tree.dofs[i], row = m_->M_rowadr[dof];
    for (int k = row; k < row + m_->M_rownnz[dof]; ++k) {
      tree.factor[n * i + tree.place[m_->M_colind[k] - tree.first]] = d_->M[k];
    }
    tree.factor[n * i + i] += ServoInertia(m_, d_, dof);
    tree.acceleration[i] = (d_->qvel[dof] - qvel_[dof]) / m_->opt.timestep;
  }
  // Impulses on a body do not act on vertices that slide in it, so these are removed from its inertia.
  for (size_t j = 0; j < tree.place.size(); ++j) {
    if (tree.place[j] >= 0) continue;
    const int dof = tree.first + static_cast<int>(j), row = m_->M_rowadr[dof];
    std::vector<double> entries(n);
    double own = 1;
    for (int k = row; k < row + m_->M_rownnz[dof]; ++k) {
      if (m_->M_colind[k] == dof) own = d_->M[k];
      const int i = tree.place[m_->M_colind[k] - tree.first];
      if (i >= 0) entries[i] = d_->M[k];
    }
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) tree.factor[n * i + k] -= entries[i] / own * entries[k];
    }
  }
  AddTies(tree, &tree.factor);
  Factor(&tree.factor, n);
  trees_.push_back(tree);
  return static_cast<int>(trees_.size()) - 1;
}

void Bodies::FillJacobian(int id, const Tree& tree, std::vector<double>* jacobian) const {
  const int n = tree.count;
  jacobian->assign(6 * n, 0);
  int with_joints = id;
  while (with_joints && !m_->body_dofnum[with_joints]) with_joints = m_->body_parentid[with_joints];
  mjtNum offset[3];
  mju_sub3(offset, d_->xipos + 3 * id, d_->subtree_com + 3 * m_->body_rootid[id]);
  for (int dof = m_->body_dofadr[with_joints] + m_->body_dofnum[with_joints] - 1; dof >= 0;
       dof = m_->dof_parentid[dof]) {
    const mjtNum* motion = d_->cdof + 6 * dof;  // Rotation, then translation of the tree's center of mass.
    const int place = tree.place[dof - tree.first];
    mjtNum linear[3];
    mju_cross(linear, motion, offset);
    mju_addTo3(linear, motion + 3);
    for (int k = 0; k < 3; ++k) {
      (*jacobian)[n * k + place] = linear[k];
      (*jacobian)[n * (3 + k) + place] = motion[k];
    }
  }
}

void Bodies::AddTies(const Tree& tree, std::vector<double>* inertia) const {
  const int n = tree.count;
  std::vector<double> jacobian;
  for (const Tie& tie : *ties_) {
    if (m_->body_treeid[tie.body] != tree.id || !(tie.mass > 0 || tie.locked)) continue;
    FillJacobian(tie.body, tree, &jacobian);
    mjtNum arm[3];
    mju_sub3(arm, tie.point, d_->xipos + 3 * tie.body);
    const mjtNum* own = m_->body_inertia + 3 * tie.body;
    const double turning = own[0] + own[1] + own[2] + m_->body_mass[tie.body] * mju_dot3(arm, arm);
    const auto add = [&](double mass, const std::vector<double>& row) {
      for (int i = 0; i < n; ++i) {
        for (int k = 0; k < n; ++k) (*inertia)[n * i + k] += mass * row[i] * row[k];
      }
    };
    for (int k = 0; k < 3; ++k) {
      std::vector<double> linear(n), angular(n);
      const int next = (k + 1) % 3, last = (k + 2) % 3;
      for (int i = 0; i < n; ++i) {
        angular[i] = jacobian[n * (3 + k) + i];
        linear[i] =
            jacobian[n * k + i] + jacobian[n * (3 + next) + i] * arm[last] - jacobian[n * (3 + last) + i] * arm[next];
      }
      add(tie.mass, linear);
      if (tie.locked) add(kLocked * turning, angular);
    }
  }
}

int Bodies::Find(int id) {
  if (m_->body_treeid[id] < 0) return -1;
  if (of_body_[id] >= 0) return of_body_[id];
  Body body = {};
  body.tree = FindTree(m_->body_treeid[id]);
  const Tree& tree = trees_[body.tree];
  const int n = tree.count;
  mju_copy3(body.center, d_->xipos + 3 * id);
  body.so_far.turn[0] = 1;
  body.response.assign(6 * n, 0);
  FillJacobian(id, tree, &body.jacobian);
  std::vector<double> column(n);
  for (int k = 0; k < 6; ++k) {
    for (int i = 0; i < n; ++i) {
      column[i] = body.jacobian[n * k + i];
      body.velocity[k] += column[i] * qvel_[tree.dofs[i]];
      body.acceleration[k] += column[i] * tree.acceleration[i];
    }
    SolveFactored(tree.factor, n, column.data());
    for (int i = 0; i < n; ++i) body.response[6 * i + k] = column[i];
  }
  double (*c)[6] = body.rigid.compliance;
  for (int k = 0; k < 6; ++k) {
    for (int l = 0; l < 6; ++l) {
      for (int i = 0; i < n; ++i) c[k][l] += body.jacobian[n * k + i] * body.response[6 * i + l];
    }
  }
  body.inverse_mass = std::max({c[0][0], c[1][1], c[2][2]});
  bool tied = false;
  for (const Tie& tie : *ties_) {
    if (tie.body != id) continue;
    tied = true;
    mjtNum arm[3];
    mju_sub3(arm, tie.point, body.center);
    body.inverse_mass = std::max(body.inverse_mass, PointCompliance(c, arm));
  }
  if (tied) {
    mjtNum turning[6];
    PointAcceleration(m_, d_, id, body.center, qvel_, nullptr, turning);
    for (int k = 0; k < 6; ++k) body.acceleration[k] += turning[k];
  }
  body.rigid.is_pushable = body.inverse_mass > kYields;
  if (!body.rigid.is_pushable) std::fill(&c[0][0], &c[0][0] + 36, 0.0);
  for (int k = 0; k < 6; ++k) body.rigid.move[k] = h_ * body.velocity[k];
  of_body_[id] = static_cast<int>(bodies_.size());
  bodies_.push_back(body);
  return of_body_[id];
}

void Bodies::Move() {
  for (Body& body : bodies_) MoveRigid(body.center, body.so_far, body.acceleration, h_, &body.rigid);
}

void Bodies::Push(const double arm[3], const double impulse[3], Body* body) {
  double wrench[6];
  mju_copy3(wrench, impulse);
  mju_cross(wrench + 3, arm, impulse);
  for (int k = 0; k < 6; ++k) {
    body->rigid.impulse[k] += wrench[k];
    for (int l = 0; l < 6; ++l) body->rigid.move[k] += body->rigid.compliance[k][l] * wrench[l];
  }
}

void Bodies::Share() {
  const auto dofs = [this](int b) { return trees_[bodies_[b].tree].count; };
  const int number = static_cast<int>(bodies_.size());
  for (int b = 0; b < number; ++b) TakeImpulses(bodies_.data(), number, b, dofs);
  for (Body& body : bodies_) EndImpulses(&body);
}

void Bodies::Finish() {
  for (Body& body : bodies_) {
    for (int k = 0; k < 6; ++k) body.moved[k] += body.impulse[k];
    FinishRigid(body.rigid, &body.so_far);
  }
}

void Bodies::Apply(const mjModel* m, mjData* d, int substeps) {
  const double dt = m->opt.timestep;
  std::vector<mjtNum> change;
  for (size_t t = 0; t < trees_.size(); ++t) {
    const Tree& tree = trees_[t];
    std::vector<double> speed(tree.count), way(tree.count);
    bool touched = false;
    for (const Body& body : bodies_) {
      if (body.tree != static_cast<int>(t) || !body.touched || !body.rigid.is_pushable) continue;
      touched = true;
      for (int i = 0; i < tree.count; ++i) {
        for (int k = 0; k < 6; ++k) {
          speed[i] += body.response[6 * i + k] * body.impulse[k] / h_;
          way[i] += body.response[6 * i + k] * body.moved[k];
        }
      }
    }
    if (!touched) continue;
    change.resize(m->nv, 0);
    for (int i = 0; i < tree.count; ++i) {
      const int dof = tree.dofs[i];
      d->qvel[dof] += speed[i];
      // MuJoCo integrated with the final velocity; substeps integrate with their own.
      change[dof] = way[i] - dt * dt * tree.acceleration[i] * (1 - 1.0 / substeps) / 2;
    }
  }
  if (!change.empty()) mj_integratePos(m, d->qpos, change.data(), 1);
}

}  // namespace softgym_mj::cloth
