// The air's drag on a triangle, and what keeps it from moving along.

#ifndef SOFTGYM_MJ_CLOTH_DRAG_H_
#define SOFTGYM_MJ_CLOTH_DRAG_H_

#include <cmath>

#include "cloth/plugin/kernels.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kAirDensity = 1.2;  // [kg/m^3]
// Vertices whose gap is below this share of the thickness touch something: they move no air.
constexpr double kTouching = 0.1;
// Layers lie across a vertex's normal, within 60 degrees. Neighbours in a fine mesh do not, however near they are.
constexpr float kAcross = 0.5f;

// Whether a pair's features are apart along a normal, which has any length.
inline bool IsAcross(const Pair& pair, const float* n) {
  const float along = pair.normal[0] * n[0] + pair.normal[1] * n[1] + pair.normal[2] * n[2];
  return along * along > kAcross * kAcross * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

// The force [N] against `normal`, which it sets, on a triangle with these corners of arrays (n, 3), `area` [m^2] and
// `density` [kg/m^2]; `drag` is its coefficient.
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
  // Of the speed at the end of the step, so that what is light stops and does not turn round.
  const double own = density * area;
  const double rate = 0.5 * kAirDensity * drag * area / own * std::fabs(Dot(*normal, v));
  return own * rate * Dot(*normal, v + timestep * a) / (1 + rate * timestep);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_DRAG_H_
