// Makes the displacements of a step obey the contacts: no layer comes through another, nothing is pushed
// into what MuJoCo's solver has kept it out of, edges stay near their length.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_
#define SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_

#include <vector>

#include "contact_kernels.h"
#include "native/coloring.h"
#include "proximity.h"
#include "rigid_contacts.h"

namespace softgym_mj {

struct ContactConfig {
  int iterations = 60;
  double stretch = 0.12;     // Contact makes edges no longer than by this share of their length,
  double compression = 0.2;  // nor shorter than by this one.
  double friction = -1;      // Between layers; negative: that of the flexes.
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
  // As in Rows.
  struct Row {
    int vertex[4];
    double weight[4];
    Vector normal;
    double compliance, least, lowest, friction;
    double gap;  // How far the pair is beyond its thickness; negative when it overlaps [m].
  };
  struct BodyRow {
    RigidContact contact;
    double scaled[3];
    double mass, tangential_mass, least;
    // As in Rows: along the normal, and tangential.
    double impulse, before, search;
    Vector held, held_before, held_search;
  };

  void SetSprings(const Mesh& mesh, const Motion& motion, double timestep);
  void AddEdgeRows(const ContactConfig& config, const Mesh& mesh, const Motion& motion);
  Row* AddRow(const int vertex[4], const double weight[4], Vector normal, double gap, double friction);
  void AddRigidRows(const std::vector<RigidContact>& rigid, const Motion& motion,
                    const std::vector<Body>& bodies);
  double Sweep(BodyRow* row, float* move, std::vector<Body>* bodies) const;
  void Extend(BodyRow* row, double share, float* move, std::vector<Body>* bodies) const;
  void Apply(const BodyRow& row, Vector impulse, float* move, std::vector<Body>* bodies) const;
  void Group(const Motion& motion);
  void Iterate(int iterations, float* move, std::vector<Body>* bodies);

  const ContactKernels* kernels_ = nullptr;
  float done_ = 0;  // Impulse [kg m] below which a sweep is the last.
  Coloring coloring_;
  std::vector<Row> rows_;
  std::vector<int> vertices_, order_;  // Those of the rows, and what places the rows have in groups_.
  std::vector<Rows<4>> groups_;
  std::vector<Rows<2>> springs_;
  std::vector<BodyRow> body_rows_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONTACT_SOLVER_H_
