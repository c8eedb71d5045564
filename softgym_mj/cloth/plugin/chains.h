// Ropes: all edges of a rope are solved together.

#ifndef SOFTGYM_MJ_CLOTH_CHAINS_H_
#define SOFTGYM_MJ_CLOTH_CHAINS_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

class ChainRows {
 public:
  // One or three numbers per edge; `vertex` has one more entry.
  struct Row {
    std::vector<int> vertex, edge;
    std::vector<float> start, length, gamma, keep, before, impulse;  // As in EdgeBlock.
    std::vector<double> lower, diagonal, right, normal;              // Linear system.
  };

  // Rebuilds the rows after a change of the mesh or of the substep length [s].
  void Reset(const Mesh& mesh, double h);
  // Starts a step. `after`: elongation of each edge after its last sweep [m].
  void Start(const std::vector<double>& position, const double* after);
  // Layers come last in a substep and stretch ropes caught between them. Ropes come last in a step: with `settles` they
  // return to their length at the end of the last sweep, which changes no velocities.
  void Solve(const Points& points, bool settles);
  // Ends a sweep: stores lengths and impulses.
  void End(const Points& points);
  // Adds the forces of edges on held vertices (n, 3) [N]: `share` times their last impulses.
  void AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const;
  // Writes `after` for the next step.
  void Keep(const Points& points, double* after) const;

  const std::vector<Row>& rows() const { return rows_; }

 private:
  std::vector<Row> rows_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_CHAINS_H_
