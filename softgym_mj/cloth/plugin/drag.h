// Air drag on a triangle, and the conditions for added mass.

#ifndef SOFTGYM_MJ_CLOTH_DRAG_H_
#define SOFTGYM_MJ_CLOTH_DRAG_H_

#include <cmath>

#include "cloth/plugin/kernels.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kAirDensity = 1.2;  // [kg/m^3]
// Vertices whose gap is below this share of the thickness touch something and have no added mass.
constexpr double kTouching = 0.1;
// The direction to another layer is within 60 degrees of a vertex's normal; that to neighbors in a fine mesh is not.
constexpr float kAcross = 0.5f;

// Whether a pair's features are separated along a normal of any length.
inline bool IsAcross(const Pair& pair, const float* n) {
  const float along = pair.normal[0] * n[0] + pair.normal[1] * n[1] + pair.normal[2] * n[2];
  return along * along > kAcross * kAcross * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

// Computes `normal` and the drag force [N] against it on a triangle with corners in arrays (n, 3), `area` [m^2],
// `density` [kg/m^2] and coefficient `drag`.
inline double Drag(const double* position, const double* velocity, const double* acceleration, const int* corner,
                   double area, double density, double drag, double timestep, Vector* normal) {
  Vector x[3], v = {0, 0, 0}, a = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    x[k] = FromArray(position + 3 * corner[k]);
    v = v + (1.0 / 3) * FromArray(velocity + 3 * corner[k]);
    a = a + (1.0 / 3) * FromArray(acceleration + 3 * corner[k]);
  }
  const Vector n = Cross(x[1] - x[0], x[2] - x[0]);
  const double twice = Norm(n);
  *normal = {0, 0, 0};
  if (!(twice > 0)) return 0;
  *normal = (1 / twice) * n;
  // Implicit in the speed at the end of the step, so that light surfaces stop and do not reverse.
  const double own = density * area;
  const double rate = 0.5 * kAirDensity * drag * area / own * std::fabs(Dot(*normal, v));
  return own * rate * Dot(*normal, v + timestep * a) / (1 + rate * timestep);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_DRAG_H_
