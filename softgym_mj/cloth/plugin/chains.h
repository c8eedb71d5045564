// Ropes: the edges of each are solved at once.

#ifndef SOFTGYM_MJ_CLOTH_CHAINS_H_
#define SOFTGYM_MJ_CLOTH_CHAINS_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

class ChainRows {
 public:
  // A number or three of each edge; vertex has one more.
  struct Row {
    std::vector<int> vertex, edge;
    std::vector<float> start, length, gamma, keep, before, impulse;  // As in EdgeBlock.
    std::vector<double> lower, diagonal, right, normal;              // Of the system.
  };

  // To be called when the mesh or the length of a substep [s] has changed.
  void Reset(const Mesh& mesh, double h);
  // `after`: by how much each edge got longer after its last sweep [m].
  void Start(const std::vector<double>& position, const double* after);
  // Layers have the last word of a substep, and stretch what is caught between them; ropes have that of a step: they
  // get as long again as when a sweep last ended (`settles`), which changes no velocities.
  void Solve(const Points& points, bool settles);
  // Ends a sweep: notes lengths and impulses.
  void End(const Points& points);
  // Adds with which force edges pull held vertices (n, 3) [N]: `share` times their last impulses.
  void AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const;
  // Writes `after` for the next step.
  void Keep(const Points& points, double* after) const;

  const std::vector<Row>& rows() const { return rows_; }

 private:
  std::vector<Row> rows_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_CHAINS_H_
