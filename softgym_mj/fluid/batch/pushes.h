// Forces of the water on walls, bit-identical to those of `Solver` and of the plugin.

#ifndef SOFTGYM_MJ_FLUID_BATCH_PUSHES_H_
#define SOFTGYM_MJ_FLUID_BATCH_PUSHES_H_

#include "fluid/batch/environment.h"
#include "fluid/batch/lists.h"
#include "fluid/plugin/pushes.h"
#include "native/rotation.h"

namespace softgym_mj::fluid {
namespace {

// Writes the terms of pairs.
struct Writer {
  double* terms;
  void operator()(int k, const double own[6]) const {
    for (int t = 0; t < 6; ++t) terms[6 * k + t] = own[t];
  }
};

// Returns the memory for terms of a wall's pairs (pairs, 6); null if the water does not push it.
inline double* TermsOf(const Environment& w, int wall) {
  const int own = w.model->walls[wall].pushed;
  return kPushes && own >= 0 ? w.terms + 6LL * (w.model->count + kLanes) * own : nullptr;
}

// Calls f(wall, index among pushed walls) for all walls that the water pushes.
template <class F>
inline void EachPushed(const Environment& w, F f) {
  if (!kPushes || w.model->num_pushed == 0) return;
  Each(w.model->num_walls, [&](int wall) {
    const int own = w.model->walls[wall].pushed;
    if (own >= 0) f(wall, own);
  });
}

inline void ClearImpulses(const Environment& w) {
  EachPushed(w, [&](int, int own) {
    for (int t = 0; t < 6; ++t) w.impulses[6 * own + t] = 0;
  });
}

// Subtracts the terms of a pushed wall, times `rate`, from its impulse and the moment about the world's origin. Lists
// are in the order of particles, so that sums do not depend on the order of threads.
inline void AddImpulses(const Environment& w, double rate) {
  EachPushed(w, [&](int wall, int own) {
    const WallPairs pairs = PairsOf(w, wall);
    const double *terms = TermsOf(w, wall), *origin = w.step->origin;
    double sums[6] = {0, 0, 0, 0, 0, 0}, linear[3];
    for (int k = 0; k < pairs.count; ++k) {
      if (pairs.particle[k] == w.model->count) continue;  // Padding.
      for (int t = 0; t < 6; ++t) sums[t] -= terms[6 * k + t];
    }
    for (int k = 0; k < 3; ++k) linear[k] = rate * sums[k];
    const double moment[3] = {origin[1] * linear[2] - origin[2] * linear[1],
                              origin[2] * linear[0] - origin[0] * linear[2],
                              origin[0] * linear[1] - origin[1] * linear[0]};
    double* impulse = w.impulses + 6 * own;
    for (int k = 0; k < 3; ++k) {
      impulse[k] += linear[k];
      impulse[3 + k] += rate * sums[3 + k] + moment[k];
    }
  });
}

// Center of mass of the body of a wall [m].
inline void CenterOf(const Environment& w, int wall, double center[3]) {
  const BatchWall& own = w.model->walls[wall];
  const double* body = w.poses + 7 * own.body;
  double turned[4] = {body[3], body[4], body[5], body[6]};
  Normalize4(turned);
  RotVecQuat(own.center, turned, center);
  for (int k = 0; k < 3; ++k) center[k] += body[k];
}

// Adds mass [kg] and moment about `center` [kg m^2] of the particles that touch a wall and none before it, as
// `Solver::TouchingInertia`. Marks of particles that touch are in `cell`.
inline void AddTouching(const Environment& w, int wall, const double center[3], double inertia[2]) {
  const Model& m = *w.model;
  const Particles& p = w.particles;
  const WallPairs pairs = PairsOf(w, wall);
  double* squares = TermsOf(w, wall);
  EachBlock(0, pairs.count / kLanes, [&](int k) { FindDistance(pairs, p.position, pairs.share, kLanes * k); });
  Each(pairs.count, [&](int k) {
    const int i = pairs.particle[k];
    squares[k] = -1;
    if (i == m.count || w.cell[i] || pairs.share[k] > kLayer * m.fluid.spacing) return;
    w.cell[i] = 1;
    squares[k] = 0;
    for (int a = 0; a < 3; ++a) {
      const double r = w.step->origin[a] + p.position[4 * i + a] - center[a];
      squares[k] += r * r;
    }
  });
  Once([&] {
    for (int k = 0; k < pairs.count; ++k) {
      if (squares[k] < 0) continue;
      inertia[0] += m.mass;
      inertia[1] += m.mass * squares[k];
    }
  });
}

// Converts the impulses of this step to forces of the next one, as the plugin's function of this name.
inline void HandOver(const Environment& w) {
  const Model& m = *w.model;
  if (!kPushes || m.num_pushed == 0) return;
  SGM_SHARED double inertias[kGroups][2], centers[kGroups][3];
  double *inertia = inertias[Group()], *center = centers[Group()];
  for (int first = 0, last; first < m.num_walls; first = last) {
    const int body = m.walls[first].body;
    for (last = first; last < m.num_walls && m.walls[last].body == body; ++last) {
    }
    if (m.walls[first].pushed < 0) continue;
    Each(m.count, [&](int i) { w.cell[i] = 0; });
    Once([&] {
      CenterOf(w, first, center);
      inertia[0] = inertia[1] = 0;
    });
    for (int wall = first; wall < last; ++wall) AddTouching(w, wall, center, inertia);
    const double* mobility = w.mobility + 2 * body;
    Each(last - first, [&](int j) {
      const int wall = first + j;
      const double* impulse = w.impulses + 6 * m.walls[wall].pushed;
      PassOn(impulse, impulse + 3, center, inertia, mobility, m.timestep, w.pending + 6 * wall, w.forces + 6 * wall);
    });
  }
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_PUSHES_H_
