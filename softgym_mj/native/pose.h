// Where bodies and geoms are at the end of a step.

#ifndef SOFTGYM_MJ_NATIVE_POSE_H_
#define SOFTGYM_MJ_NATIVE_POSE_H_

#include <mujoco/mujoco.h>

namespace softgym_mj {

struct Pose {
  double position[3];
  double quaternion[4];  // (w, x, y, z), unit.
};

// Velocity of a body, as that of the point of it that is at the world's origin [m/s] and its rotation [rad/s].
struct Twist {
  double linear[3], angular[3];
};

// Whether a body moves by joints: neither fixed to the world nor carried by a mocap body alone.
bool IsDynamic(const mjModel* m, int body);

// Whether a body is the world or fixed to it: neither joints nor a mocap body move it.
bool IsFixed(const mjModel* m, int body);

// World pose of a body from qpos and mocap_pos. Unlike xpos it is never stale: mj_step leaves xpos
// at the start of the step, and dm_control steps in an order of its own. With `twist`, its velocity from qvel, too.
Pose BodyPose(const mjModel* m, const mjData* d, int body, Twist* twist = nullptr);

// Linear and angular acceleration (6,) of a point of a body in a step from velocities `qvel` to `end`, or what it is if
// they stay, without the latter. From poses at the start of the step.
void PointAcceleration(const mjModel* m, const mjData* d, int body, const mjtNum* point, const mjtNum* qvel,
                       const mjtNum* end, mjtNum* acceleration);

// World pose of a geom, given that of its body.
Pose GeomPose(const mjModel* m, int geom, const Pose& body);

// Whether all seven numbers are finite and none is huge: see `AreSane`.
bool IsSane(const Pose& pose);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_POSE_H_
