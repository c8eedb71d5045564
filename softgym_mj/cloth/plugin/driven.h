// Driven vertices, such as those held by a gripper. Springs and solids do not move them; layers and planes do, so that
// nothing is squeezed between immovable vertices. The driver then corrects the resulting tracking error.

#ifndef SOFTGYM_MJ_CLOTH_DRIVEN_H_
#define SOFTGYM_MJ_CLOTH_DRIVEN_H_

#include <vector>

#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

class Driven {
 public:
  void Start(const cloth::Start& start);
  // Calls `sweep` with driven vertices released, so that contact acts on both sides. It moves them without changing
  // their velocities.
  template <class F>
  void TwoWayPass(const Points& points, const F& sweep) {
    Release(points);
    sweep();
    Hold(points);
  }
  // Adds their displacement in the step of `timestep` [s] to the motion, and restores their masses.
  void Finish(const Mesh& mesh, double timestep, Motion* motion) const;

 private:
  void Release(const Points& points);
  void Hold(const Points& points);

  struct Vertex {
    int id;
    float inverse_mass;  // [1/kg]
    float place[3];      // Displacement before a pass [m].
    double given[3];     // Displacement by contact in the step [m].
  };
  std::vector<Vertex> vertices_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_DRIVEN_H_
