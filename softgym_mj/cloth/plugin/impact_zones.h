// Fail-safe: vertices that would pass through each other in a step form impact zones, which move rigidly.

#ifndef SOFTGYM_MJ_CLOTH_IMPACT_ZONES_H_
#define SOFTGYM_MJ_CLOTH_IMPACT_ZONES_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/meets.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// Motion of the vertices in a step.
struct Motion {
  const double* start;           // (n, 3) [m]
  std::vector<double> move;      // (n, 3) [m]
  std::vector<double> velocity;  // (n, 3) [m/s], at the end.
  std::vector<double> mass;      // [kg]; huge where something holds a vertex.
};

// Motion of impact zones: rigid motion, which conserves momentum, or none.
enum class Zones { kMove, kStand };

class ImpactZones {
 public:
  // Changes the motion so that no pair comes nearer than a tenth of its distance: rigid impact zones (Bridson, Fedkiw
  // and Anderson, Robust Treatment of Collisions, 2002, section 7.2). Returns the number of changed vertices.
  int Prevent(const ClothKernels& kernels, const std::vector<Pair>& pairs, Zones zones, Motion* motion);

 private:
  // Whether all vertices of a pair are in one zone.
  bool AreOne(const Pair& pair);

  std::vector<int> zone_, near_;
  std::vector<double> sum_;  // Sums of each zone.
  AlignedFloats move_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_IMPACT_ZONES_H_
