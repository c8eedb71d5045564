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

// A fixed plane, a boundary of vertices.
struct PlaneContact {
  double point[3], normal[3];
  std::vector<float> friction;  // Friction coefficient with each flex.
  std::vector<bool> touches;    // Whether it touches each flex.
};

class Planes {
 public:
  // Finds vertices that may touch in a step. `layers`: null if no bodies are near; otherwise rows near bodies are swept
  // repeatedly, and planes with them.
  void Start(const Mesh& mesh, const cloth::Start& start, const std::vector<PlaneContact>& contacts,
             const Layers* layers, const Points& points, double timestep);
  // Marks the vertices that are nearer than this share of their radius.
  void MarkTouching(const Mesh& mesh, double share, std::vector<bool>* touches) const;
  // Warm start: near vertices start with a share of the impulses of the last substep.
  void Warm(const ClothKernels& kernels, const Points& points, float share);
  // `pass`: of near vertices; others have one sweep a substep.
  void Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  void SweepNear(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  // Lifts vertices of zones that a held vertex would pull into a plane; returns whether there were any.
  bool LiftOut(const cloth::Start& start, Motion* motion) const;

 private:
  struct Active {
    float normal[3];
    AlignedFloats gap, friction, impulse;
    std::vector<int> blocks, near_blocks;  // Blocks that may touch, and blocks pushed by bodies.

    Plane View(const std::vector<int>& some);
    Plane Far() { return View(blocks); }
    Plane Near() { return View(near_blocks); }
  };

  std::vector<Active> actives_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PLANES_H_
