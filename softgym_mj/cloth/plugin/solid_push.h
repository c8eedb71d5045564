// Impulses between eight points of a flex and a body, under the restrictions of native/simd.h.

#ifndef SOFTGYM_MJ_CLOTH_SOLID_PUSH_H_
#define SOFTGYM_MJ_CLOTH_SOLID_PUSH_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/sweeps.h"
#include "native/simd.h"

namespace softgym_mj::cloth {
namespace {

// One of six numbers. As an array with a variable index they would lie in the slow memory of a GPU's thread.
inline double OneOf(int i, double a, double b, double c, double d, double e, double f) {
  const double low = i == 0 ? a : i == 1 ? b : c, high = i == 3 ? d : i == 4 ? e : f;
  return i < 3 ? low : high;
}

// A change of the impulses on eight points that is applied to the vertices, and the opposite to the body. What it needs
// is read first, so that a GPU reads while it computes the change.
class SolidPush {
 public:
  SolidPush(const Points& points, const SolidBlock& block, Rigid* body) : now_(points.now), block_(block), body_(body) {
    for (int k = 0; k < 3; ++k) {
      x_[k] = Gather(now_, block.vertex[k], &mass_[k]);
      weight_[k] = Lanes::Load(block.weight[k]);
    }
    moves_body_ = kSolids && body && body->is_pushable;
    arm_ = Load3(block.arm);
  }

  void Apply(const Lanes3& change) const {
    for (int k = 0; k < 3; ++k) {
      Scatter(now_, block_.vertex[k], AddScaled(x_[k], weight_[k] * mass_[k], change), mass_[k]);
    }
    if (!moves_body_) return;
    const Lanes3 moment = {NegativeMultiplyAdd(arm_.z, change.y, arm_.y * change.z),
                           NegativeMultiplyAdd(arm_.x, change.z, arm_.z * change.x),
                           NegativeMultiplyAdd(arm_.y, change.x, arm_.x * change.y)};
    const double wrench[6] = {-Sum(change.x), -Sum(change.y), -Sum(change.z),
                              -Sum(moment.x), -Sum(moment.y), -Sum(moment.z)};
    EachLane([&](int i) {
      if (i >= 6) return;
      double sum = 0;
      for (int j = 0; j < 6; ++j) sum += body_->compliance[i][j] * wrench[j];
      body_->impulse[i] += OneOf(i, wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]);
      body_->move[i] += sum;
    });
    WaitLanes();
  }

 private:
  float* now_;
  const SolidBlock& block_;
  Rigid* body_;
  bool moves_body_;
  Lanes mass_[3], weight_[3];
  Lanes3 x_[3], arm_;
};

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLID_PUSH_H_
