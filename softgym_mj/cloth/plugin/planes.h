// Contact of vertices with planes.

#ifndef SOFTGYM_MJ_CLOTH_PLANES_H_
#define SOFTGYM_MJ_CLOTH_PLANES_H_

#include <vector>

#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/layers.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// A fixed plane that vertices stay in front of.
struct PlaneContact {
  double point[3], normal[3];
  std::vector<float> friction;  // With each flex.
  std::vector<bool> touches;    // Each flex.
};

class Planes {
 public:
  // Finds what may touch in a step. `layers`: null if there are no bodies about. Else rows near them are swept again
  // and again, and the planes with them.
  void Start(const Mesh& mesh, const cloth::Start& start, const std::vector<PlaneContact>& contacts,
             const Layers* layers, const Points& points, double timestep);
  // Marks the vertices that are nearer than this share of their radius.
  void MarkTouching(const Mesh& mesh, double share, std::vector<bool>* touches) const;
  // Near vertices start with a share of the impulses of the last substep.
  void Warm(const ClothKernels& kernels, const Points& points, float share);
  // `pass`: of near vertices; others have one sweep a substep.
  void Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  void SweepNear(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  // Lifts what moves as one with something that is held, and would be pulled into a plane by it. Whether there was any.
  bool LiftOut(const cloth::Start& start, Motion* motion) const;

 private:
  struct Active {
    float normal[3];
    AlignedFloats gap, friction, impulse;
    std::vector<int> blocks, near_blocks;  // Those that may touch, and that bodies push.

    Plane View(const std::vector<int>& some);
    Plane Far() { return View(blocks); }
    Plane Near() { return View(near_blocks); }
  };

  std::vector<Active> actives_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PLANES_H_
