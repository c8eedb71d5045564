// Elements and vertices of flexes.

#ifndef SOFTGYM_MJ_NATIVE_FLEX_H_
#define SOFTGYM_MJ_NATIVE_FLEX_H_

#include <string>
#include <vector>

#include <mujoco/mujoco.h>

namespace softgym_mj {

// A triangle of a cloth or a segment of a rope.
struct FlexElement {
  int vertex[3];  // In the order of mjModel; a segment has its second one twice.
  bool surface;   // Whether it is a triangle.
  double radius;  // Half the thickness [m].
};

// Collects all elements of the model's flexes. Returns "" or an error that names a flex which is neither a rope nor a
// cloth.
std::string CollectFlexes(const mjModel* m, std::vector<FlexElement>* elements);

// Whether three slides, along axes at right angles, move a body.
bool OnSlides(const mjModel* m, int body);

// Computes world positions (nflexvert, 3) of vertices from qpos and mocap_pos, as BodyPose. Returns false if one is not
// finite or huge (`AreSane`).
bool FindVertices(const mjModel* m, const mjData* d, std::vector<mjtNum>* positions);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_FLEX_H_
