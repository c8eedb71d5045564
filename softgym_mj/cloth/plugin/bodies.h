// Rigid bodies that flexes push: effective mass at contact points, and the effect of impulses.

#ifndef SOFTGYM_MJ_CLOTH_BODIES_H_
#define SOFTGYM_MJ_CLOTH_BODIES_H_

#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/rigid.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

// A body during a step. It moves as MuJoCo has moved it, plus impulses.
struct Body {
  int tree;                // Index in the trees of `Bodies`.
  double center[3];        // Center of mass at the start of the step [m].
  Displacement so_far;     // Since then.
  double velocity[6];      // Linear and angular velocity at the start of the step.
  double acceleration[6];  // Mean acceleration of the step without flexes.
  double impulse[6];       // Sum of impulses of the substeps so far [kg m].
  double moved[6];         // Sum of these sums.
  double inverse_mass;     // Largest in any direction [1/kg].
  bool touched;
  Rigid rigid;
  std::vector<double> jacobian, response;  // (6, n) and (n, 6) with the n degrees of freedom of its tree.
};

// Largest compliance [1/kg] of a point at `arm` [m] over all directions.
double PointCompliance(const double c[6][6], const double arm[3]);

class Bodies {
 public:
  // Starts a step. `qvel`: velocities at its start. `ties`: ties of vertices to bodies.
  void Start(const mjModel* m, const mjData* d, const mjtNum* qvel, const std::vector<Tie>& ties, double h);
  // Returns the index of one of the model's bodies in `all`; -1 if it is static.
  int Find(int id);
  // Moves all bodies by a substep without contact.
  void Move();
  // Applies an impulse to a body at `arm` from its center [m].
  void Push(const double arm[3], const double impulse[3], Body* body);
  // Propagates the impulses of a sweep to the other bodies of the tree.
  void Share();
  // Ends a substep.
  void Finish();
  // Adds the impulses to qvel and qpos.
  void Apply(const mjModel* m, mjData* d, int substeps);

  std::vector<Body>& all() { return bodies_; }
  const std::vector<Body>& all() const { return bodies_; }

 private:
  struct Tree {
    int id, first, count;              // Tree id; first and number of its degrees of freedom.
    std::vector<int> dofs;             // (n,) Degrees of freedom without those of flex vertices below a body.
    std::vector<int> place;            // Index in `dofs` of each degree of freedom of the tree, or -1.
    std::vector<double> factor;        // Lower Cholesky factor of the inertia (n, n).
    std::vector<double> acceleration;  // (n,)
  };

  int FindTree(int id);
  // Fills the Jacobian (6, n) of a body's center of mass, linear and angular.
  void FillJacobian(int id, const Tree& tree, std::vector<double>* jacobian) const;
  // Adds the inertia (n, n) of vertices tied to bodies of the tree.
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
