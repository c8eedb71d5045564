#include "cloth/plugin/impacts.h"

#include <algorithm>
#include <numeric>

#include "native/closest.h"

namespace softgym_mj::cloth {
namespace {

// A pair may come as near as this share of its distance in one step.
constexpr double kNearest = 0.1;
// Pairs that are nearer than this [m] are past help: to hold them would only freeze them where they are.
constexpr float kPast = 1e-4f;
constexpr int kMaxAdvances = 100;  // Of one pair: as good as touching after that.
constexpr int kMaxRounds = 100;
constexpr double kImmovable = 1e9;  // [kg] A zone that weighs more goes where it is carried.

double Distance(bool edges, const Vector x[4]) {
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
// section 5): steps that are never longer than the distance allows.
bool Meets(const Pair& pair, const Motion& motion) {
  const int first = 1 + pair.edges;  // Number of vertices on the first side.
  Vector u[4], x[4], mean = {0, 0, 0};
  for (int k = 0; k < 4; ++k) {
    u[k] = FromArray(&motion.move[3 * pair.vertex[k]]);
    x[k] = FromArray(motion.start + 3 * pair.vertex[k]);
    mean = mean + 0.25 * u[k];
  }
  double fastest[2] = {0, 0};
  for (int k = 0; k < 4; ++k) {
    u[k] = u[k] - mean;
    fastest[k >= first] = std::max(fastest[k >= first], Norm(u[k]));
  }
  double distance = Distance(pair.edges, x), time = 0;
  const double speed = fastest[0] + fastest[1], nearest = kNearest * distance;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const double advance = 0.9 * (distance - 0.5 * nearest) / speed;
    time += advance;
    if (time >= 1) return false;
    for (int k = 0; k < 4; ++k) x[k] = x[k] + advance * u[k];
    distance = Distance(pair.edges, x);
    if (distance < nearest) return true;
  }
  return true;
}

int Root(std::vector<int>* parent, int v) {
  while ((*parent)[v] != v) v = (*parent)[v] = (*parent)[(*parent)[v]];
  return v;
}

}  // namespace

bool Impacts::AreOne(const Pair& pair) {
  bool one = !zone_.empty();
  for (int k = 1; one && k < 4; ++k) one = Root(&zone_, pair.vertex[0]) == Root(&zone_, pair.vertex[k]);
  return one;
}

int Impacts::Prevent(const ClothKernels& kernels, const std::vector<Pair>& pairs, Zones zones, Motion* motion) {
  const int count = static_cast<int>(motion->mass.size());
  zone_.clear();
  near_.resize(pairs.size());
  move_.resize(4 * count);
  int changed = 0;
  for (int round = 0; round < kMaxRounds; ++round) {
    for (int v = 0; v < count; ++v) {
      for (int k = 0; k < 3; ++k) move_[4 * v + k] = static_cast<float>(motion->move[3 * v + k]);
    }
    // The plane across the normal between the closest points parts the two sides of all others.
    const int approaching =
        kernels.FindApproaching(move_.data(), pairs.data(), static_cast<int>(pairs.size()), 1 - kNearest, near_.data());
    bool found = false;
    for (int i = 0; i < approaching; ++i) {
      const Pair& pair = pairs[near_[i]];
      if (pair.distance < kPast || AreOne(pair) || !Meets(pair, *motion)) continue;
      if (zone_.empty()) {
        zone_.resize(count);
        std::iota(zone_.begin(), zone_.end(), 0);
      }
      found = true;
      for (int k = 1; k < 4; ++k) {
        const int a = Root(&zone_, pair.vertex[0]), b = Root(&zone_, pair.vertex[k]);
        zone_[std::max(a, b)] = std::min(a, b);
      }
    }
    if (!found) break;
    // Mass, displacement and velocity times mass, number of vertices.
    sum_.assign(8 * count, 0);
    for (int v = 0; v < count; ++v) {
      double* s = &sum_[8 * Root(&zone_, v)];
      s[0] += motion->mass[v];
      s[7] += 1;
      for (int k = 0; k < 3; ++k) {
        s[1 + k] += motion->mass[v] * motion->move[3 * v + k];
        s[4 + k] += motion->mass[v] * motion->velocity[3 * v + k];
      }
    }
    changed = 0;
    for (int v = 0; v < count; ++v) {
      const double* s = &sum_[8 * Root(&zone_, v)];
      if (s[7] == 1) continue;
      ++changed;
      const double share = zones == Zones::kMove || s[0] > kImmovable ? 1 / s[0] : 0;
      for (int k = 0; k < 3; ++k) {
        motion->move[3 * v + k] = share * s[1 + k];
        motion->velocity[3 * v + k] = share * s[4 + k];
      }
    }
  }
  return changed;
}

}  // namespace softgym_mj::cloth
