// Removes displacements of impact zones into solids.

#include "cloth/plugin/lift.h"
#include "cloth/plugin/solids.h"

namespace softgym_mj::cloth {

void Solids::LiftOut(const Points& points, Motion* motion) const {
  for (int round = 0; round < kLiftRounds; ++round) {
    for (const Active& active : actives_) {
      if (active.body >= 0) continue;  // Dynamic bodies are skipped: between two bodies there may be no room.
      for (const auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
        for (const SolidBlock& block : *blocks) {
          for (int lane = 0; block.active && lane < kBlock; ++lane) {
            Lift(points, block, lane, motion->move.data(), motion->velocity.data());
          }
        }
      }
    }
  }
}

}  // namespace softgym_mj::cloth
