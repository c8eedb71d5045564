// What the vertices start a step with.

#ifndef SOFTGYM_MJ_CLOTH_START_H_
#define SOFTGYM_MJ_CLOTH_START_H_

#include <vector>

namespace softgym_mj::cloth {

// A vertex that a body with joints carries, or that an equality ties to one.
struct Tie {
  int vertex, body;  // Of the solver's mesh and of the model.
  double point[3];   // Where the body holds it at the start of the step [m].
  double mass;       // [kg] Of the vertex, if the body's inertia lacks it.
  bool locked;       // Whether it keeps the body from turning, too.
};

struct Start {
  std::vector<double> position;      // (n, 3) [m]
  std::vector<double> velocity;      // (n, 3) [m/s]
  std::vector<double> acceleration;  // (n, 3) [m/s^2], mean of the step without flexes' forces.
  std::vector<float> inverse_mass;   // [1/kg], 0 if something holds or carries a vertex.
  std::vector<float> yielding;       // The same towards layers and planes: not 0 if it is held.
  std::vector<Tie> ties;             // At most one of a vertex.
  std::vector<bool> rides;           // Whether a vertex moves with a body that gives way: see tied.h.

  bool IsFree(int v) const { return inverse_mass[v] > 0 && !rides[v]; }
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_START_H_
