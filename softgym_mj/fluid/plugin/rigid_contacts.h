// The contacts that MuJoCo found between flexes and geoms, and the bodies of these geoms.

#ifndef SOFTGYM_MJ_FLUID_RIGID_CONTACTS_H_
#define SOFTGYM_MJ_FLUID_RIGID_CONTACTS_H_

#include <vector>

#include <mujoco/mujoco.h>

#include "native/closest.h"
#include "mesh.h"

namespace softgym_mj {

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
  bool solved;      // By MuJoCo's solver.
  double impulse;   // If so, what pushes them apart already, and
  double softness;  // what they give way for a further impulse [1/kg].
  double gap;       // If nothing pushes, by how much they may approach [m].
  double friction;
  int body;         // In the list of bodies, or -1 if it cannot give way.
};

class RigidContacts {
 public:
  std::vector<RigidContact> contacts;
  std::vector<Body> bodies;  // As they move now; to be changed by whoever solves the contacts.

  void Find(const mjModel* m, const mjData* d, const Mesh& mesh, const std::vector<Vector>& start);
  // Adds the impulses on the bodies to qvel, and those on `positions` to qpos.
  void Apply(const mjModel* m, mjData* d, const std::vector<Body>& positions);

 private:
  int FindBody(const mjModel* m, const mjData* d, int id);

  std::vector<int> ids_;  // Of the bodies in the model.
  std::vector<mjtNum> jacobian_, response_, change_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_RIGID_CONTACTS_H_
