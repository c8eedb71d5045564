// Where bodies and geoms are at the end of a step.

#ifndef SOFTGYM_MJ_NATIVE_POSE_H_
#define SOFTGYM_MJ_NATIVE_POSE_H_

#include <mujoco/mujoco.h>

namespace softgym_mj {

struct Pose {
  double position[3];
  double quaternion[4];  // (w, x, y, z), unit.
};

// Whether a body moves by joints: neither fixed to the world nor carried by a mocap body alone.
bool IsDynamic(const mjModel* m, int body);

// Whether a body is the world or fixed to it: neither joints nor a mocap body move it.
bool IsFixed(const mjModel* m, int body);

// World pose of a body from qpos and mocap_pos. Unlike xpos it is never stale: mj_step leaves xpos
// at the start of the step, and dm_control steps in an order of its own.
Pose BodyPose(const mjModel* m, const mjData* d, int body);

// World pose of a geom, given that of its body.
Pose GeomPose(const mjModel* m, int geom, const Pose& body);

// Whether all seven numbers are finite and none is huge: see `AreSane`.
bool IsSane(const Pose& pose);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_POSE_H_
