// Makes the displacements of a step obey the contacts: no layer comes through another, nothing is pushed
// into what MuJoCo's solver has kept it out of, edges stay near their length.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_
#define SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_

#include <vector>

#include "proximity.h"
#include "rigid_contacts.h"

namespace softgym_mj {

struct ContactConfig {
  int iterations = 40;
  double stretch = 0.5;       // Longest that contact makes an edge, as a share of its length.
  double compression = 0.5;   // The same for what it takes off.
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
