// Poses of bodies and geoms at the end of a step.

#ifndef SOFTGYM_MJ_NATIVE_POSE_H_
#define SOFTGYM_MJ_NATIVE_POSE_H_

#include <mujoco/mujoco.h>

namespace softgym_mj {

struct Pose {
  double position[3];
  double quaternion[4];  // (w, x, y, z), unit.
};

// Velocity of a body: of its point at the world's origin [m/s], and angular velocity [rad/s].
struct Twist {
  double linear[3], angular[3];
};

// Whether joints move a body: it is neither fixed to the world nor carried by a mocap body alone.
bool IsDynamic(const mjModel* m, int body);

// Whether a body is the world or fixed to it: neither joints nor a mocap body move it.
bool IsFixed(const mjModel* m, int body);

// World pose of a body from qpos and mocap_pos. Unlike xpos it is never stale: mj_step leaves xpos
// at the start of the step, and dm_control steps in an order of its own. With `twist`, its velocity from qvel, too.
Pose BodyPose(const mjModel* m, const mjData* d, int body, Twist* twist = nullptr);

// Computes the linear and angular acceleration (6,) of a point of a body in a step from velocities `qvel` to `end`, or
// for constant velocities if `end` is null, from poses at the start of the step.
void PointAcceleration(const mjModel* m, const mjData* d, int body, const mjtNum* point, const mjtNum* qvel,
                       const mjtNum* end, mjtNum* acceleration);

// World pose of a geom, given that of its body.
Pose GeomPose(const mjModel* m, int geom, const Pose& body);

// Whether all seven numbers are finite and not huge (`AreSane`).
bool IsSane(const Pose& pose);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_POSE_H_
