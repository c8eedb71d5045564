// End of a step: prevents penetration, as `Solver::Finish` and `ImpactZones`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_FINISH_H_
#define SOFTGYM_MJ_CLOTH_BATCH_FINISH_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/search.h"
#include "cloth/batch/springs.h"
#include "cloth/batch/touch.h"
#include "cloth/plugin/lift.h"
#include "cloth/plugin/meets.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

// Zone of a vertex, identified by its lowest vertex.
inline int ZoneOf(const Environment& w, int v) {
  while (w.zone[v] != v) v = w.zone[v];
  return v;
}

// Moves impact zones rigidly, or stops them if `stand`, as `ImpactZones::Prevent`.
SGM_APART int PreventImpacts(const Environment& w, bool stand) {
  const Model& m = *w.model;
  Step* step = w.step;
  const int n = m.vertices;
  Each(n, [&](int v) { w.zone[v] = v; });
  Once([&] { step->changed = 0; });
  for (int round = 0; round < kMaxRounds; ++round) {
    Each(n, [&](int v) {
      for (int k = 0; k < 3; ++k) w.end[4 * v + k] = static_cast<float>(w.motion[3 * v + k]);
    });
    Once([&] { step->num_near = 0; });
    Each(step->num_found, [&](int i) {
      const Pair& pair = w.found[i];
      if (!Approaches(w.end, pair, 1 - kNearest)) return;
      bool one = true;
      for (int k = 1; k < 4; ++k) one = one && ZoneOf(w, pair.vertex[0]) == ZoneOf(w, pair.vertex[k]);
      if (pair.distance < kPast || one || !Meets(pair, w.start, w.motion)) return;
      w.near[Add(&step->num_near, 1)] = i;
    });
    if (step->num_near == 0) break;
    Once([&] {
      for (int i = 0; i < step->num_near; ++i) {
        const Pair& pair = w.found[w.near[i]];
        for (int k = 1; k < 4; ++k) {
          const int a = ZoneOf(w, pair.vertex[0]), b = ZoneOf(w, pair.vertex[k]);
          w.zone[a > b ? a : b] = a > b ? b : a;
        }
      }
      // Mass, displacement and velocity times mass, number of vertices.
      for (int i = 0; i < 8 * n; ++i) w.sum[i] = 0;
      for (int v = 0; v < n; ++v) {
        double* s = w.sum + 8 * ZoneOf(w, v);
        s[0] += w.mass[v];
        s[7] += 1;
        for (int k = 0; k < 3; ++k) {
          s[1 + k] += w.mass[v] * w.motion[3 * v + k];
          s[4 + k] += w.mass[v] * w.speed[3 * v + k];
        }
      }
      step->changed = 0;
    });
    Each(n, [&](int v) {
      const double* s = w.sum + 8 * ZoneOf(w, v);
      if (s[7] == 1) return;
      Add(&step->changed, 1);
      const double share = !stand || s[0] > kImmovable ? 1 / s[0] : 0;
      for (int k = 0; k < 3; ++k) {
        w.motion[3 * v + k] = share * s[1 + k];
        w.speed[3 * v + k] = share * s[4 + k];
      }
    });
  }
  const int changed = step->changed;
  Wait();
  return changed;
}

// Alternates impact zones and rope constraints, as `Solver::Prevent`.
SGM_APART int Prevent(const Environment& w) {
  const int n = w.model->vertices;
  int more = PreventImpacts(w, false), changed = more;
  for (int pass = 0; more && pass < kRopePasses && w.model->chains > 0; ++pass) {
    Each(n, [&](int v) {
      for (int k = 0; k < 3; ++k) w.points.now[4 * v + k] = static_cast<float>(w.motion[3 * v + k]);
    });
    for (int solve = 0; solve < kRopeSolves; ++solve) SolveChains(w, true);
    Each(n, [&](int v) {
      const bool moves = w.points.now[4 * v + 3] > 0;
      for (int k = 0; moves && k < 3; ++k) w.motion[3 * v + k] = w.points.now[4 * v + k];
    });
    more = PreventImpacts(w, false);
    changed += more;
  }
  return changed;
}

// Lifts vertices out of the plane, as `Planes::LiftOut`; returns whether there were any.
SGM_APART bool LiftOut(const Environment& w) {
  const Model& m = *w.model;
  Once([&] { w.step->lifted = 0; });
  Each(m.vertices, [&](int v) {
    if (w.yielding[v] == 0) return;
    double *move = w.motion + 3 * v, *velocity = w.speed + 3 * v, way = 0, speed = 0;
    float normal[3];
    for (int k = 0; k < 3; ++k) {
      normal[k] = static_cast<float>(m.plane_normal[k]);
      way += normal[k] * move[k];
      speed += normal[k] * velocity[k];
    }
    const double gap = w.plane_gap[v], lift = (gap < -kPressed ? gap : -kPressed) - (gap + way);
    if (!(lift > 0)) return;
    SetBits(&w.step->lifted, 1);
    for (int k = 0; k < 3; ++k) {
      move[k] += lift * normal[k];
      velocity[k] -= (speed < 0 ? speed : 0.0) * normal[k];
    }
  });
  return w.step->lifted;
}

// Removes displacements of impact zones into static solids, as `Solids::LiftOut`.
inline void LiftOutOfStatic(const Environment& w) {
  const Model& m = *w.model;
  for (int round = 0; round < kLiftRounds; ++round) {
    for (int i = 0; i < m.grippers + Solids(m); ++i) {
      const int t = m.At<int>(m.order_at)[i];
      if (!m.At<Solid>(m.solids_at)[t].is_static) continue;
      const Touch& touch = w.touch[t];
      const auto lift = [&](const SolidBlock& block) {
        if (!block.active) return;
        OneLane([&] {
          for (int lane = 0; lane < kBlock; ++lane) Lift(w.points, block, lane, w.motion, w.speed);
        });
      };
      EachColor(touch.points, [&](int b) { lift(touch.point_blocks[b]); });
      EachColor(touch.triangles, [&](int b) { lift(touch.triangle_blocks[b]); });
    }
  }
}

// Computes displacements and final velocities of the step.
inline void FinishMotion(const Environment& w) {
  const Model& m = *w.model;
  Step* step = w.step;
  const int n = m.vertices;
  Each(n, [&](int v) {
    const bool held = w.inverse_mass[v] == 0;
    w.mass[v] = held ? 1e12 : m.At<double>(m.mass_at)[v];
    for (int k = 0; k < 3; ++k) {
      const float now = w.points.now[4 * v + k];
      w.motion[3 * v + k] = held ? m.timestep * w.velocity[3 * v + k] : now;
      w.speed[3 * v + k] = held ? w.velocity[3 * v + k] : (static_cast<double>(now) - w.points.before[4 * v + k]) / m.h;
    }
  });
  Each(step->num_driven, [&](int i) {
    const int v = w.driven[i];
    w.mass[v] = m.At<double>(m.mass_at)[v];
    for (int k = 0; k < 3; ++k) {
      w.motion[3 * v + k] += w.given[3 * i + k];
      w.speed[3 * v + k] += w.given[3 * i + k] / m.timestep;
    }
  });
  int changed = Prevent(w);
  // Pairs beyond the search margin may be close by now.
  const float most = kSearchMargin * m.thickness;
  for (int search = 0; search < kMaxSearches; ++search) {
    Each(3, [&](int k) {
      double mean = 0;
      for (int v = 0; v < n; ++v) mean += w.motion[3 * v + k] / n;
      step->mean[k] = mean;
      if (k == 0) step->furthest = 0;
    });
    Each(n, [&](int v) {
      float square = 0;
      for (int k = 0; k < 3; ++k) {
        w.end[4 * v + k] = static_cast<float>(w.motion[3 * v + k] - step->mean[k]);
        const float d = w.end[4 * v + k] - w.move[4 * v + k];
        square += d * d;
      }
      TakeLargest(&step->furthest, square);
    });
    if (step->furthest <= most * most) break;
    Each(n, [&](int v) {
      for (int k = 0; k < 3; ++k) w.move[4 * v + k] = w.end[4 * v + k];
    });
    FindPairs(w);
    const int more = Prevent(w);
    changed += more;
    if (!more) break;
  }
  if (!changed) return;
  // Entry faces of small solids are those at the end of the motion.
  const bool stands = kSolids && m.static_solids > 0;
  for (int round = 0; (TouchesBodies(w) || stands) && round < kLifts; ++round) {
    Each(4 * m.padded, [&](int i) { w.points.before[i] = w.points.now[i]; });
    Each(n, [&](int v) {
      for (int k = 0; k < 3; ++k) w.points.now[4 * v + k] = static_cast<float>(w.motion[3 * v + k]);
    });
    FindTouches(w, 1);
    if (stands) LiftOutOfStatic(w);
  }
  // Zones that are squeezed against a plane stop.
  if (LiftOut(w)) PreventImpacts(w, true);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_FINISH_H_
