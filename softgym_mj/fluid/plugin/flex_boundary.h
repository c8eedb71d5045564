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

// Motion of flexes in a step: elements, and their vertices (n, 3) at its start and its end [m].
struct FlexMotion {
  std::vector<FlexElement> elements;
  std::vector<mjtNum> start, end;
};

// Zero for a vector without length.
inline Vector Unit(Vector a) {
  const double length = Norm(a);
  return length > 0 ? (1 / length) * a : Vector{0, 0, 0};
}

// Four planes that bound the distance to an element from below: the plane of a triangle, and planes perpendicular to it
// through its sides, or through the ends of a segment.
struct ElementBound {
  float x[4], y[4], z[4], offset[4];

  // Lower bound of the squared distance of `p` from the element.
  float SquaredDistance(const float* p) const {
    float height[4];
    for (int k = 0; k < 4; ++k) height[k] = x[k] * p[0] + y[k] * p[1] + z[k] * p[2] - offset[k];
    const float beside = std::max(std::max(0.0f, height[1]), std::max(height[2], height[3]));
    return height[0] * height[0] + beside * beside;
  }
  // Whether the element is certainly further from `p` than `reach`.
  bool OutOfReach(const float* p, float reach, float slack) const {
    const float most = reach + slack;
    return most < 0 || SquaredDistance(p) > most * most;
  }
};

// Flexes as walls of a solver. It handles particles one by one in double precision, because few are near a flex.
class FlexBoundary {
 public:
  // Starts a step with the initial positions of particles and vertices, from here on relative to `origin`. Velocities
  // move a particle by `way` in a substep at most.
  void Begin(const FlexMotion& motion, const double origin[3], const FluidConstants& fluid, const Particles& p,
             double way, int substeps);
  // Starts the next substep, which ends at `fraction` of the step.
  void Place(double fraction);

  // The next four functions are called in this order in a substep. Finds the particles near flexes at the predicted
  // positions; `order` holds the index of each at the start of the step.
  void FindNear(const Particles& p, const int* order);
  // Adds the density of water behind cloth, as for other walls.
  void FindShares(const Particles& p);
  void MultiplyFreeShare(const Particles& p) const;
  void AddGradient(const Particles& p);
  // Adds to the corrections of particles. `wall_push` converts pressure times slope to a displacement.
  void Collide(const Particles& p, float wall_push);
  // Stops particles that other walls would push through cloth.
  void Guard(const Particles& p) const;

  // Whether a particle had too many near elements in this step, of which the furthest were left out.
  bool too_many() const { return too_many_; }

  // Drags particles along by a share of the difference in velocity after the last substep of h [s]; needs FindNear and
  // FindShares.
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
  // An element that may be near, and a lower bound of its distance when it was found.
  struct Candidate {
    double distance;
    int element;
  };
  // Elements near an earlier position of a particle, a range of `candidates_`, sorted by distance.
  struct List {
    float position[3];
    double fraction = -1;  // Fraction of the step at that position; negative means none.
    int first = 0, last = 0, room = 0;
  };
  // Data of a particle with near elements.
  struct Near {
    int particle;
    int first, last;
    double moved;  // Upper bound of the decrease of distances since the elements were found.
    int element;   // Element nearest to the predicted position, or -1.
    double weight[3];
    double gap;  // Upper bound of the distance of the predicted position to the nearest surface.
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
  bool active_ = false;              // Whether a particle can come into range in this step.
  double low_[3], high_[3];          // Box around all points within range of an element.
  std::vector<Vector> from_, move_;  // Vertices: where they start, displacement in the step.
  std::vector<Vector> start_, end_;  // The same in this substep.
  double fraction_;                  // Fraction of the step at the end of the substep.
  double furthest_, longest_;        // Largest displacement in the step and the substep [m].
  double cell_;                      // Width of a cell of the grid [m].
  std::vector<int> cells_, entries_, cell_start_, in_cell_;
  std::vector<int> everywhere_;  // Elements outside the grid, which may be near any particle.
  int most_;                     // Largest number of stored elements near a particle.
  bool too_many_ = false;
  std::vector<char> is_used_;
  std::vector<int> used_;             // Elements that have been near a particle.
  std::vector<ElementBound> bounds_;  // Their bounds at the end of the substep.
  std::vector<List> lists_;
  std::vector<Candidate> candidates_;
  std::vector<Near> near_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_FLEX_BOUNDARY_H_
