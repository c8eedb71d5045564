// Vertices that something drives, such as a gripper. Springs and solids do not move them; layers and planes do, so that
// nothing is squeezed between what cannot give way. They lag behind by that, and who drives them brings them back.

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
  // Calls `sweep` with the vertices as if they were free. It moves them, but does not change their velocities.
  template <class F>
  void TwoWayPass(const Points& points, const F& sweep) {
    Release(points);
    sweep();
    Hold(points);
  }
  // Adds by how much they have given way in the step [s], and gives them their masses.
  void Finish(const Mesh& mesh, double timestep, Motion* motion) const;

 private:
  void Release(const Points& points);
  void Hold(const Points& points);

  struct Vertex {
    int id;
    float inverse_mass;  // [1/kg]
    float place[3];      // Before it gives way [m],
    double given[3];     // and by how much it has in the step.
  };
  std::vector<Vertex> vertices_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_DRIVEN_H_
