// Cloth and ropes as walls: particles stay on their side of every triangle and out of every rope.

#ifndef SOFTGYM_MJ_FLUID_FLEX_BOUNDARY_H_
#define SOFTGYM_MJ_FLUID_FLEX_BOUNDARY_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels.h"
#include "motion.h"
#include "native/closest.h"
#include "native/flex.h"

namespace softgym_mj {

// What moves in a step: elements, and their vertices (n, 3) at its start and its end [m].
struct FlexMotion {
  std::vector<FlexElement> elements;
  std::vector<mjtNum> start, end;
};

// Zero for a vector without length.
inline Vector Unit(Vector a) {
  const double length = Norm(a);
  return length > 0 ? (1 / length) * a : Vector{0, 0, 0};
}

// Four planes. A point is at least as far from an element as from the first, and as it is above any
// other: those through the sides of a triangle, across it, or through the ends of a segment.
struct ElementBound {
  float x[4], y[4], z[4], offset[4];

  // Squared distance of `p` from the element, at least.
  float SquaredDistance(const float* p) const {
    float height[4];
    for (int k = 0; k < 4; ++k) height[k] = x[k] * p[0] + y[k] * p[1] + z[k] * p[2] - offset[k];
    const float beside = std::max(std::max(0.0f, height[1]), std::max(height[2], height[3]));
    return height[0] * height[0] + beside * beside;
  }
  // Whether the element is further from `p` than `reach` for sure.
  bool OutOfReach(const float* p, float reach, float slack) const {
    const float most = reach + slack;
    return most < 0 || SquaredDistance(p) > most * most;
  }
};

// The walls' part of a solver. Double precision, one particle after the other: the particles near a
// flex are few. Those far from all cost next to nothing.
class FlexBoundary {
 public:
  // Called at the start of a step, with particles and vertices where they start; positions are relative
  // to `origin` from here on. Velocities move a particle by `way` in a substep at most.
  void Begin(const FlexMotion& motion, const double origin[3], const FluidConstants& fluid, const Particles& p,
             double way, int substeps);
  // Moves on to the next substep, which ends after this fraction of the step.
  void Place(double fraction);

  // In a substep, in this order. Finds the particles near flexes at the predicted positions; `order`
  // tells what was the place of each at the start of the step.
  void FindNear(const Particles& p, const int* order);
  // A cloth adds the density of water behind it, as other walls do.
  void FindShares(const Particles& p);
  void MultiplyFreeShare(const Particles& p) const;
  void AddGradient(const Particles& p);
  // Moves particles by adding to their corrections. `wall_push` turns pressure times slope into what
  // the pressure moves them by.
  void Collide(const Particles& p, float wall_push);
  // Stops those that other walls would have pushed through a cloth.
  void Guard(const Particles& p) const;

  // Whether a particle had too many elements near it in this step, of which the furthest did not count.
  bool too_many() const { return too_many_; }

  // After the last substep, of h seconds: drags particles along by a share of the difference in
  // velocity. Needs FindNear and FindShares.
  void Drag(const Particles& p, float viscosity, float h) const;

 private:
  // A point of an element: weights of its corners, offset of the particle from it.
  struct Foot {
    double weight[3];
    Vector offset;
    double distance;
  };
  // A displacement that undoes an overlap, and the point of the element that gives it.
  struct Push {
    int element;
    double weight[3];
    Vector direction;
    double length;
  };
  // An element that may be near, and how far its surface was at least when it was found.
  struct Candidate {
    double distance;
    int element;
  };
  // The elements near a place where a particle was, in `candidates_`: the nearest come first.
  struct List {
    float position[3];
    double fraction = -1;  // Of the step, when it was there; negative: never.
    int first = 0, last = 0, room = 0;
  };
  // What is known of a particle that has such elements.
  struct Near {
    int particle;
    int first, last;
    double moved;  // How much nearer elements can be than when they were found.
    int element;   // Whose surface is nearest to the prediction, or -1.
    double weight[3];
    double gap;  // Distance of the prediction to the nearest surface of any kind, or more.
    Vector normal;
    double share, slope;
  };

  double Reach() const;
  double ListDistance(const FlexElement& e) const;
  void FillGrid();
  ElementBound MakeBound(const FlexElement& e) const;
  void Look(const float x[3], List* list);
  Foot Closest(const FlexElement& e, const std::vector<Vector>& x, Vector p) const;
  Vector At(const FlexElement& e, const std::vector<Vector>& x, const double weight[3]) const;
  double Approach(const FlexElement& e, Vector way) const;
  bool Meets(const FlexElement& e, Vector from, Vector way, double distance, double hold) const;
  Push FindPush(const FlexElement& e, Vector from, Vector x) const;
  bool Passes(const Near& near, Vector from, Vector x) const;
  Vector Carry(const Near& near, Vector from) const;

  static constexpr double kNowhere = 1e30;

  const FlexMotion* motion_ = nullptr;
  FluidConstants fluid_;
  float slack_;
  bool active_ = false;              // Whether a particle can come into reach in this step.
  double low_[3], high_[3];          // Box around all that is in reach of an element.
  std::vector<Vector> from_, move_;  // Vertices: where they start, displacement in the step.
  std::vector<Vector> start_, end_;  // The same in this substep.
  double fraction_;                  // Of the step, at the end of the substep.
  double furthest_, longest_;        // Largest displacement in the step and the substep [m].
  double cell_;                      // Width of a cell of the grid [m].
  std::vector<int> cells_, entries_, cell_start_, in_cell_;
  std::vector<int> everywhere_;  // Elements that are in no cell: they may be near any.
  int most_;                     // Elements that are kept of those near a particle.
  bool too_many_ = false;
  std::vector<char> is_used_;
  std::vector<int> used_;             // Elements that have been near a particle.
  std::vector<ElementBound> bounds_;  // Of these, at the end of the substep.
  std::vector<List> lists_;
  std::vector<Candidate> candidates_;
  std::vector<Near> near_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_FLEX_BOUNDARY_H_
