// Makes the displacements of a step obey the contacts: no layer comes through another, nothing is pushed
// into what MuJoCo's solver has kept it out of, edges stay near their length.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_
#define SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_

#include <vector>

#include "proximity.h"

namespace softgym_mj {

struct ContactConfig {
  int iterations = 40;
  double stretch = 0.25;      // Longest that contact makes an edge, as a share of its length.
  double compression = 0.45;  // The same for what it takes off.
};

// A rigid body that a flex touches and that can give way. Impulses in kg m, as in contact_kernels.h.
struct Body {
  Vector move, turn;         // Displacement of its reference point and rotation in the step.
  double compliance[6][6];   // Inverse inertia: change of move and turn for an impulse and its moment.
  double wrench[6];          // Sum of the impulses and their moments.
};

// A contact that MuJoCo found between a flex and a geom.
struct RigidContact {
  int vertex[3];
  double weight[3];
  Vector normal;    // From the geom to the flex.
  Vector position;  // Relative to the body's reference point.
  Vector carried;   // Displacement of the geom there, if its body cannot give way.
  bool solved;      // By MuJoCo's solver.
  double softness;  // If so, what they give way for a further impulse [1/kg].
  double gap;       // By how much they may approach, until they touch or as the solver has it [m].
  double friction;
  int body;         // In the list of bodies, or -1.
};

class ContactSolver {
 public:
  // Changes motion->move and `bodies` to what the velocities shall be; `position` and `position_bodies`
  // become what the positions shall change by.
  void Solve(const ContactConfig& config, double timestep, const Mesh& mesh,
             const std::vector<Pair>& pairs, const std::vector<RigidContact>& rigid, Motion* motion,
             std::vector<Body>* bodies, std::vector<float>* position,
             std::vector<Body>* position_bodies);

 private:
  struct BodyRow {
    RigidContact contact;
    double scaled[3];
    double mass, tangential_mass, least;
    // As in Row: along the normal, and tangential.
    double impulse, before, search;
    Vector held, held_before, held_search;
  };

  void AddSprings(const Mesh& mesh, const Motion& motion, double timestep);
  void AddEdgeRows(const ContactConfig& config, const Mesh& mesh, const Motion& motion);
  void AddRow(const int vertex[4], const double weight[4], Vector normal, double gap, double friction,
              const Motion& motion, double softness = 0);
  void AddRigidRows(const std::vector<RigidContact>& rigid, const Motion& motion,
                    const std::vector<Body>& bodies);
  double Sweep(BodyRow* row, float* move, std::vector<Body>* bodies) const;
  void Extend(BodyRow* row, double share, float* move, std::vector<Body>* bodies) const;
  void Apply(const BodyRow& row, Vector impulse, float* move, std::vector<Body>* bodies) const;
  void Iterate(int iterations, float* move, std::vector<Body>* bodies);

  const ContactKernels* kernels_ = nullptr;
  float done_ = 0;  // Impulse [kg m] below which a sweep is the last.
  std::vector<Spring> springs_;
  std::vector<Row> rows_;
  std::vector<BodyRow> body_rows_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_
