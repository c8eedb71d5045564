// Continuous collision detection of two features in a step.

#ifndef SOFTGYM_MJ_CLOTH_MEETS_H_
#define SOFTGYM_MJ_CLOTH_MEETS_H_

#include <algorithm>

#include "cloth/plugin/kernels.h"
#include "native/closest.h"

namespace softgym_mj::cloth {

constexpr double kPressed = 1e-3;  // [m] Depth to which impact zones may press vertices into solids and planes.

namespace {

// A pair may come as near as this share of its distance in one step.
constexpr double kNearest = 0.1;
// [m] Closer pairs are ignored: holding them would only freeze them.
constexpr float kPast = 1e-4f;
constexpr int kMaxAdvances = 100;  // Iterations per pair, after which it counts as touching.
constexpr int kMaxRounds = 100;
constexpr double kImmovable = 1e9;  // [kg] A heavier zone moves with its held vertices.

inline double PairDistance(bool edges, const Vector x[4]) {
  if (edges) {
    double s, t;
    ClosestOnSegments(x[0], x[1], x[2], x[3], &s, &t);
    return Norm((1 - s) * x[0] + s * x[1] - (1 - t) * x[2] - t * x[3]);
  }
  double w[3];
  ClosestOnTriangle(x[0], x[1], x[2], x[3], w);
  return Norm(x[0] - w[0] * x[1] - w[1] * x[2] - w[2] * x[3]);
}

// Additive continuous collision detection (Li, Kaufman and Jiang, Codimensional Incremental Potential Contact, 2021,
// section 5): steps that are never longer than the distance allows. `start` and `move`: (n, 3) [m].
inline bool Meets(const Pair& pair, const double* start, const double* move) {
  const int first = 1 + pair.edges;  // Number of vertices on the first side.
  Vector u[4], x[4], mean = {0, 0, 0};
  for (int k = 0; k < 4; ++k) {
    u[k] = FromArray(move + 3 * pair.vertex[k]);
    x[k] = FromArray(start + 3 * pair.vertex[k]);
    mean = mean + 0.25 * u[k];
  }
  double fastest[2] = {0, 0};
  for (int k = 0; k < 4; ++k) {
    u[k] = u[k] - mean;
    fastest[k >= first] = std::max(fastest[k >= first], Norm(u[k]));
  }
  double distance = PairDistance(pair.edges, x), time = 0;
  const double speed = fastest[0] + fastest[1], nearest = kNearest * distance;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const double advance = 0.9 * (distance - 0.5 * nearest) / speed;
    time += advance;
    if (time >= 1) return false;
    for (int k = 0; k < 4; ++k) x[k] = x[k] + advance * u[k];
    distance = PairDistance(pair.edges, x);
    if (distance < nearest) return true;
  }
  return true;
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MEETS_H_
