// Twist of the model's ropes.

#ifndef SOFTGYM_MJ_CLOTH_TWISTS_H_
#define SOFTGYM_MJ_CLOTH_TWISTS_H_

#include <vector>

#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

class TwistRows {
 public:
  struct Rope {
    int part;  // Index of the flex.
    bool is_ring, is_clamped;
    double stiffness;  // Moment per angle [N m].
    std::vector<int> vertex;
    std::vector<double> way, next, change, pull;  // As in TwistRow.
    double* angle = nullptr;                      // Its angle in the state; null in a step in which it is free.
  };

  // Rebuilds the rows of ropes that twist after a change of the mesh or of the substep length [s].
  void Reset(const Mesh& mesh, double h);
  // Starts a step. `angles`: twist of each flex [rad]. Ropes with a free end lose theirs.
  void Start(const cloth::Start& start, double* angles);
  // Starts a substep: follows the points and pushes them.
  void Push(const Points& points);
  // Ends a step: follows the final positions.
  void End(const cloth::Start& start, const Motion& motion);

  const std::vector<Rope>& ropes() const { return ropes_; }

 private:
  std::vector<Rope> ropes_;
  const double* position_ = nullptr;  // Positions at the start of the step.
  double h_ = 0;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_TWISTS_H_
