// Which geoms are walls of the fluid, and where they are at the end of a step.

#ifndef SOFTGYM_MJ_FLUID_BOUNDARY_H_
#define SOFTGYM_MJ_FLUID_BOUNDARY_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "kernels.h"

namespace softgym_mj {

// A geom that holds particles back.
struct Wall {
  int geom;
  int body;
  Shape shape;
  float size[3];  // As in mjModel.geom_size.
};

struct Pose {
  double position[3];
  double quaternion[4];  // (w, x, y, z), unit.
};

// The geoms of the bodies that carry `instance` and, if `world`, of the world body where they can
// collide. Meshes, height fields and signed distance fields are not supported: returns "" or a
// sentence that names the geom.
std::string CollectWalls(const mjModel* m, int instance, bool world, std::vector<Wall>* walls);

// Whether a body moves by joints: neither fixed to the world nor carried by a mocap body alone.
bool IsDynamic(const mjModel* m, int body);

// World pose of a body from qpos and mocap_pos. Unlike xpos it is never stale: mj_step leaves xpos
// at the start of the step, and dm_control steps in an order of its own.
Pose BodyPose(const mjModel* m, const mjData* d, int body);

constexpr size_t kMaxWalls = 4096;

// World pose of a geom, given that of its body.
Pose GeomPose(const mjModel* m, int geom, const Pose& body);

// Whether all seven numbers are finite.
bool IsFinite(const Pose& pose);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_BOUNDARY_H_
