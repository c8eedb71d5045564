// Springs of surfaces: rows of edges and hinges in blocks; and code shared by edges of surfaces and ropes.

#ifndef SOFTGYM_MJ_CLOTH_SPRINGS_H_
#define SOFTGYM_MJ_CLOTH_SPRINGS_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// Constants b and b / (k h^2) of a row (kernels.h).
struct Compliance {
  double b, gamma;
};
Compliance Comply(double stiffness, double damping, double h);

// Adds a force [N] along `way` to the force of a vertex (n, 3) if it is held.
void AddForceIfHeld(const Points& points, int vertex, const float way[3], double force, std::vector<double>* forces);

// Edges of surfaces, solved by one sweep.
class EdgeRows {
 public:
  // To be called when the mesh or the length of a substep [s] has changed.
  void Reset(const Mesh& mesh, double h);
  // Starts a step. `after`: elongation of each edge after its last sweep [m].
  void Start(const cloth::Start& start, const double* after);
  void Sweep(const ClothKernels& kernels, const Points& points);
  // Adds the forces of edges on held vertices (n, 3) [N]: `share` times their impulses in the last sweep.
  void AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const;
  // Writes `after` for the next step.
  void Keep(const Points& points, double* after) const;

  const Aligned<EdgeBlock>& blocks() const { return blocks_; }
  // One for each of blocks(), or none if no edge stiffens.
  const Aligned<StiffeningBlock>& stiffening() const { return stiffening_; }
  // The edge of each lane, or -1.
  const std::vector<int>& order() const { return order_; }

 private:
  Aligned<EdgeBlock> blocks_;
  Aligned<StiffeningBlock> stiffening_;
  std::vector<int> order_;
  std::vector<int> held_;  // Lanes of edges with a vertex that is held.
};

// Bending of surfaces and of ropes.
class HingeRows {
 public:
  // To be called when the mesh or the length of a substep [s] has changed.
  void Reset(const Mesh& mesh, double h);
  void Start(const std::vector<double>& position);
  // Solves bending in every interval()-th substep.
  void Bend(const ClothKernels& kernels, const Points& points, int substep);

  const Aligned<HingeBlock>& blocks() const { return blocks_; }
  // The hinge of each lane, or -1.
  const std::vector<int>& order() const { return order_; }
  // Substeps between solutions of bending.
  int interval() const { return interval_; }

 private:
  Aligned<HingeBlock> blocks_;
  std::vector<int> order_;
  int interval_ = 1;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SPRINGS_H_
