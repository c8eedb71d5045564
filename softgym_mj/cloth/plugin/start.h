// Initial state of the vertices in a step.

#ifndef SOFTGYM_MJ_CLOTH_START_H_
#define SOFTGYM_MJ_CLOTH_START_H_

#include <vector>

namespace softgym_mj::cloth {

// Tie of a vertex to a body with joints that carries it or is constrained to it.
struct Tie {
  int vertex, body;  // Vertex of the solver's mesh, body of the model.
  double point[3];   // Point of the body at the start of the step [m].
  double mass;       // [kg] Mass of the vertex if the body's inertia does not include it.
  bool locked;       // Whether it also prevents rotation of the body.
};

struct Start {
  std::vector<double> position;      // (n, 3) [m]
  std::vector<double> velocity;      // (n, 3) [m/s]
  std::vector<double> acceleration;  // (n, 3) [m/s^2], mean of the step without flexes' forces.
  std::vector<float> inverse_mass;   // [1/kg], 0 for held and carried vertices.
  std::vector<float> yielding;       // [1/kg] For layers and planes: not 0 for held vertices.
  std::vector<Tie> ties;             // At most one per vertex.
  std::vector<bool> rides;           // Whether a vertex moves with a dynamic body (tied.h).

  bool IsFree(int v) const { return inverse_mass[v] > 0 && !rides[v]; }
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_START_H_
