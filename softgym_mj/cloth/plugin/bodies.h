// Rigid bodies that flexes push: what they weigh where they are touched, and what becomes of the impulses.

#ifndef SOFTGYM_MJ_CLOTH_BODIES_H_
#define SOFTGYM_MJ_CLOTH_BODIES_H_

#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

// A body during a step. It moves on as MuJoCo has moved it, and by impulses.
struct Body {
  int tree;                // Among those of `Bodies`.
  double centre[3];        // Of mass, at the start of the step [m].
  double turn[4];          // Quaternion of its rotation since then.
  double shift[3];         // Of the centre since then [m].
  double velocity[6];      // Linear and angular, at the start of the step.
  double acceleration[6];  // Mean of the step without flexes.
  double impulse[6];       // Sum of the substeps so far [kg m], and
  double moved[6];         // the sum of these sums.
  bool gives_way;
  double inverse_mass;  // Largest in any direction [1/kg].
  bool touched;
  Rigid rigid;
  std::vector<double> jacobian, response;  // (6, n) and (n, 6) with the n degrees of freedom of its tree.
};

// What a point at `arm` [m] gives way for an impulse of 1 in any direction, at most [1/kg].
double PointCompliance(const double c[6][6], const double arm[3]);

class Bodies {
 public:
  // To be called first in a step. `qvel`: velocities at its start. `ties`: of vertices to bodies.
  void Start(const mjModel* m, const mjData* d, const mjtNum* qvel, const std::vector<Tie>& ties, double h);
  // The body that carries a geom; null if nothing moves it.
  Body* Find(int body);
  // Moves all freely for a substep.
  void Move();
  // Gives a body an impulse at `arm` from its centre [m].
  void Push(const double arm[3], const double impulse[3], Body* body);
  // Passes on what a sweep did to one body to the others of its tree.
  void Share();
  // Ends a substep.
  void Finish();
  // Adds the impulses to qvel and qpos.
  void Apply(const mjModel* m, mjData* d, int substeps);

  std::vector<Body>& all() { return bodies_; }
  const std::vector<Body>& all() const { return bodies_; }

 private:
  struct Tree {
    int id, first, count;              // Of the degrees of freedom, without those of vertices of flexes below a body.
    std::vector<int> dofs;             // (n,)
    std::vector<int> place;            // Among these of each degree of freedom of the tree, or -1.
    std::vector<double> factor;        // Lower Cholesky factor of the inertia (n, n).
    std::vector<double> acceleration;  // (n,)
  };

  int FindTree(int id);
  // Fills (6, n): velocity of a body's centre of mass, linear and angular.
  void FillJacobian(int id, const Tree& tree, std::vector<double>* jacobian) const;
  // Adds what ties to bodies of the tree add to the inertia (n, n).
  void AddTies(const Tree& tree, std::vector<double>* inertia) const;

  const mjModel* m_ = nullptr;
  const mjData* d_ = nullptr;
  const mjtNum* qvel_ = nullptr;
  const std::vector<Tie>* ties_ = nullptr;
  double h_ = 0;
  std::vector<Tree> trees_;
  std::vector<Body> bodies_;
  std::vector<int> of_body_;  // Index of each of the model's bodies, or -1.
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BODIES_H_
