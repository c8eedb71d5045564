#include "pose.h"

#include "reset.h"

namespace softgym_mj {

bool IsDynamic(const mjModel* m, int body) { return m->body_jntnum[m->body_weldid[body]] > 0; }

bool IsFixed(const mjModel* m, int body) {
  // Mocap bodies, which only the world can have as their parent, count as welded to it.
  return m->body_weldid[body] == 0 && m->body_mocapid[m->body_rootid[body]] < 0;
}

namespace {

// Adds a rotation about a point.
void AddTurn(const mjtNum* angular, const mjtNum* point, Twist* twist) {
  mjtNum linear[3];
  mju_cross(linear, point, angular);
  mju_addTo3(twist->linear, linear);
  mju_addTo3(twist->angular, angular);
}

}  // namespace

Pose BodyPose(const mjModel* m, const mjData* d, int body, Twist* twist) {
  Pose pose = {{0, 0, 0}, {1, 0, 0, 0}};
  if (twist) *twist = {};
  if (body == 0) return pose;
  int joint = m->body_jntadr[body], count = m->body_jntnum[body];
  if (count == 1 && m->jnt_type[joint] == mjJNT_FREE) {
    const mjtNum* q = d->qpos + m->jnt_qposadr[joint];
    mjtNum turn[3];
    mju_copy3(pose.position, q);
    mju_copy4(pose.quaternion, q + 3);
    mju_normalize4(pose.quaternion);
    if (twist) {
      const mjtNum* velocity = d->qvel + m->jnt_dofadr[joint];
      mju_rotVecQuat(turn, velocity + 3, pose.quaternion);
      mju_copy3(twist->linear, velocity);
      AddTurn(turn, pose.position, twist);
    }
    return pose;
  }
  int mocap = m->body_mocapid[body];
  const mjtNum* position = mocap >= 0 ? d->mocap_pos + 3 * mocap : m->body_pos + 3 * body;
  mjtNum quaternion[4];
  mju_copy4(quaternion, mocap >= 0 ? d->mocap_quat + 4 * mocap : m->body_quat + 4 * body);
  mju_normalize4(quaternion);
  Pose parent = BodyPose(m, d, m->body_parentid[body], twist);
  mju_mulPose(pose.position, pose.quaternion, parent.position, parent.quaternion, position, quaternion);
  for (int j = joint; j < joint + count; ++j) {
    const mjtNum *q = d->qpos + m->jnt_qposadr[j], *velocity = d->qvel + m->jnt_dofadr[j];
    mjtNum q0 = m->qpos0[m->jnt_qposadr[j]];
    mjtNum axis[3], anchor[3], offset[3], turn[4];
    mju_rotVecQuat(axis, m->jnt_axis + 3 * j, pose.quaternion);
    mju_rotVecQuat(anchor, m->jnt_pos + 3 * j, pose.quaternion);
    mju_addTo3(anchor, pose.position);
    if (m->jnt_type[j] == mjJNT_SLIDE) {
      mju_addToScl3(pose.position, axis, q[0] - q0);
      if (twist) mju_addToScl3(twist->linear, axis, velocity[0]);
      continue;
    }
    if (m->jnt_type[j] == mjJNT_BALL) {
      mju_copy4(turn, q);
      mju_normalize4(turn);
    } else {
      mju_axisAngle2Quat(turn, m->jnt_axis + 3 * j, q[0] - q0);
    }
    mju_mulQuat(pose.quaternion, pose.quaternion, turn);
    mju_rotVecQuat(offset, m->jnt_pos + 3 * j, pose.quaternion);
    mju_sub3(pose.position, anchor, offset);
    if (!twist) continue;
    if (m->jnt_type[j] == mjJNT_BALL) {
      mju_rotVecQuat(axis, velocity, pose.quaternion);
    } else {
      mju_scl3(axis, axis, velocity[0]);
    }
    AddTurn(axis, anchor, twist);
  }
  mju_normalize4(pose.quaternion);
  return pose;
}

void PointAcceleration(const mjModel* m, const mjData* d, int body, const mjtNum* point, const mjtNum* qvel,
                       const mjtNum* end, mjtNum* acceleration) {
  mjtNum velocity[6] = {}, gained[6] = {};  // Rotation, then translation of the tree's center of mass.
  int with_joints = body;
  while (with_joints && !m->body_dofnum[with_joints]) with_joints = m->body_parentid[with_joints];
  for (int dof = m->body_dofadr[with_joints] + m->body_dofnum[with_joints] - 1; dof >= 0; dof = m->dof_parentid[dof]) {
    mju_addToScl(velocity, d->cdof + 6 * dof, qvel[dof], 6);
    mju_addToScl(gained, d->cdof_dot + 6 * dof, qvel[dof], 6);
    if (end) mju_addToScl(gained, d->cdof + 6 * dof, (end[dof] - qvel[dof]) / m->opt.timestep, 6);
  }
  mjtNum offset[3], moved[3], turned[3];
  mju_sub3(offset, point, d->subtree_com + 3 * m->body_rootid[body]);
  mju_cross(moved, velocity, offset);
  mju_addTo3(moved, velocity + 3);
  mju_cross(turned, gained, offset);
  mju_cross(acceleration, velocity, moved);
  mju_addTo3(acceleration, turned);
  mju_addTo3(acceleration, gained + 3);
  mju_copy3(acceleration + 3, gained);
}

Pose GeomPose(const mjModel* m, int geom, const Pose& body) {
  Pose pose;
  mju_mulPose(pose.position, pose.quaternion, body.position, body.quaternion, m->geom_pos + 3 * geom,
              m->geom_quat + 4 * geom);
  mju_normalize4(pose.quaternion);
  return pose;
}

bool IsSane(const Pose& pose) { return AreSane(pose.position, 3) && AreSane(pose.quaternion, 4); }

}  // namespace softgym_mj
