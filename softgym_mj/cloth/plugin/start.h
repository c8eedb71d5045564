// What the vertices start a step with.

#ifndef SOFTGYM_MJ_CLOTH_START_H_
#define SOFTGYM_MJ_CLOTH_START_H_

#include <vector>

namespace softgym_mj::cloth {

struct Start {
  std::vector<double> position;      // (n, 3) [m]
  std::vector<double> velocity;      // (n, 3) [m/s]
  std::vector<double> acceleration;  // (n, 3) [m/s^2], mean of the step without flexes' forces.
  std::vector<float> inverse_mass;   // [1/kg], 0 if something holds or carries a vertex.
  std::vector<float> yielding;       // The same towards layers and planes: not 0 if it is held.
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_START_H_
