// The last resort: what would still pass through each other in a step moves together instead.

#ifndef SOFTGYM_MJ_FLUID_IMPACT_H_
#define SOFTGYM_MJ_FLUID_IMPACT_H_

#include <vector>

#include "proximity.h"

namespace softgym_mj {

// Merges the displacements of vertices until no pair passes through each other; both arguments alike,
// judged by motion->move. Keeps their total momentum. Returns the number of vertices changed.
int PreventImpacts(const std::vector<Pair>& pairs, Motion* motion, std::vector<float>* velocity);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_IMPACT_H_
