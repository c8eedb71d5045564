// The last resort: vertices that would pass through each other in a step move as one instead.

#ifndef SOFTGYM_MJ_CLOTH_IMPACTS_H_
#define SOFTGYM_MJ_CLOTH_IMPACTS_H_

#include <vector>

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {

// What the vertices do in a step.
struct Motion {
  const double* start;           // (n, 3) [m]
  std::vector<double> move;      // (n, 3) [m]
  std::vector<double> velocity;  // (n, 3) [m/s], at the end.
  std::vector<double> mass;      // [kg]; huge where something holds a vertex.
};

// Changes the motion so that no pair comes nearer than a tenth of its distance, or as near as it gets: rigid impact
// zones (Bridson, Fedkiw and Anderson, Robust Treatment of Collisions, 2002, section 7.2), which keep the momentum.
// Returns how many vertices are changed.
int PreventImpacts(const ClothKernels& kernels, const std::vector<Pair>& pairs, Motion* motion);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_IMPACTS_H_
