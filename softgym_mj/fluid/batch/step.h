// Step of the water of one environment, bit-identical to that of `Solver`.

#ifndef SOFTGYM_MJ_FLUID_BATCH_STEP_H_
#define SOFTGYM_MJ_FLUID_BATCH_STEP_H_

#include "fluid/batch/environment.h"
#include "fluid/batch/lists.h"
#include "fluid/batch/pushes.h"
#include "fluid/batch/separate.h"
#include "fluid/plugin/sweep.h"
#include "native/rotation.h"

namespace softgym_mj::fluid {
namespace {

constexpr double kStray = 100;  // [m] As in solver.cc; particles further away are flagged.

// Finds the poses of walls at the start and the end of the step.
inline void FindPoses(const Environment& w) {
  const Model& m = *w.model;
  const bool known = *w.known != 0;
  Wait();
  Each(m.num_walls, [&](int i) {
    const BatchWall& wall = m.walls[i];
    double *from = w.step->from + 7 * i, *to = w.step->to + 7 * i, *stored = w.walls + 7 * i;
    const double world[7] = {0, 0, 0, 1, 0, 0, 0};
    const double* body = wall.body < 0 ? world : w.poses + 7 * wall.body;
    double turned[4] = {body[3], body[4], body[5], body[6]};
    Normalize4(turned);
    RotVecQuat(wall.position, turned, to);
    for (int k = 0; k < 3; ++k) to[k] += body[k];
    MulQuat(turned, wall.quaternion, to + 3);
    Normalize4(to + 3);
    const bool stays = known && WayOfWall(wall.shape, wall.size, stored, to) <= m.reach;
    for (int k = 0; k < 7; ++k) {
      from[k] = stays ? stored[k] : to[k];
      stored[k] = to[k];
    }
  });
  Once([&] { *w.known = 1; });
}

// Interpolates poses of walls at a fraction of the step, relative to the origin.
inline void PlaceWalls(const Environment& w, double fraction) {
  Each(w.model->num_walls, [&](int i) {
    const double *a = w.step->from + 7 * i, *b = w.step->to + 7 * i;
    double position[3], quaternion[4], matrix[9], dot = 0;
    for (int k = 3; k < 7; ++k) dot += a[k] * b[k];
    const double sign = dot < 0 ? -1 : 1;
    for (int k = 0; k < 3; ++k) position[k] = a[k] + fraction * (b[k] - a[k]);
    for (int k = 0; k < 4; ++k) quaternion[k] = a[3 + k] + fraction * (sign * b[3 + k] - a[3 + k]);
    Normalize4(quaternion);
    Quat2Mat(quaternion, matrix);
    float* out = w.step->wall_end + 12 * i;
    for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(position[k] - w.step->origin[k]);
    for (int k = 0; k < 9; ++k) out[3 + k] = static_cast<float>(matrix[k]);
  });
}

inline void Load(const Environment& w) {
  const Model& m = *w.model;
  const Particles& p = w.particles;
  SumAll<double>(w, [&](int i, int k) { return w.positions[3 * i + k]; });
  Each(3, [&](int k) {
    w.step->origin[k] = std::round(w.step->sum[k] / m.count);
    w.step->furthest[k] = 0;
  });
  Once([&] {
    w.step->flags = 0;
    w.step->margin = 0;
    w.step->too_many = false;
  });
  Each(m.count, [&](int i) {
    for (int k = 0; k < 3; ++k) {
      const double x = w.positions[3 * i + k] - w.step->origin[k];
      TakeLargest(&w.step->furthest[k], std::fabs(x));
      p.position[4 * i + k] = static_cast<float>(x < -kFurthest ? -kFurthest : x > kFurthest ? kFurthest : x);
      p.velocity[4 * i + k] = static_cast<float>(w.velocities[3 * i + k]);
    }
    p.position[4 * i + 3] = p.velocity[4 * i + 3] = 0;
    w.order[i] = i;
  });
  float *x = const_cast<float*>(p.x), *y = const_cast<float*>(p.y), *z = const_cast<float*>(p.z);
  Each(kLanes, [&](int k) { x[m.count + k] = y[m.count + k] = z[m.count + k] = kFar; });
  Each(4, [&](int k) {
    const int dummy = 4 * m.count + k;
    p.position[dummy] = p.old_position[dummy] = kFar;
    p.velocity[dummy] = p.correction[dummy] = 0;
    p.packed[dummy] = k < 3 ? kFar : 0;
    if (k == 0) p.pressure[m.count] = 0;
  });
  Once([&] {
    for (int k = 0; k < 3; ++k) {
      if (w.step->furthest[k] > kStray) w.step->flags |= kScattered;
    }
  });
}

inline void Substep(Environment* w, int later) {
  const Model& m = *w->model;
  const Particles& p = w->particles;
  const FluidConstants fluid = m.fluid;
  float fall[3];
  for (int k = 0; k < 3; ++k) fall[k] = static_cast<float>(m.gravity[k]) * m.h;
  Each(m.count, [&](int i) {
    for (int k = 0; k < 4; ++k) p.old_position[4 * i + k] = p.position[4 * i + k];
    Fall(p, i, fall, m.max_speed, m.h);
  });
  if (ListsExpired(*w)) BuildLists(w, later);
  Each(m.count + 1, [&](int i) {
    Store4(p.wall_gradient + 4 * i, 0, 0, 0, 0);
    p.free_share[i] = 1;
    if (i == 0) w->step->crowded = false;
  });
  for (int wall = 0; wall < m.num_walls; ++wall) {
    const WallPairs pairs = PairsOf(*w, wall);
    EachBlock(0, pairs.count / kLanes, [&](int k) { FindWallShare(fluid, p, pairs, kLanes * k); });
  }
  for (int wall = 0; wall < m.num_walls; ++wall) {
    const WallPairs pairs = PairsOf(*w, wall);
    Each(pairs.count, [&](int k) { AddWallGradient(p, pairs, k); });
  }
  Each(m.count, [&](int i) { p.wall_density[i] = fluid.rest_density * (1.0f - p.free_share[i]); });
  EachBlock(0, m.count, [&](int i) {
    if (fluid.cohesion > 0) {
      FindPressureOf<true>(fluid, p, w->neighbors, i);
    } else {
      FindPressureOf<false>(fluid, p, w->neighbors, i);
    }
  });
  if (w->step->crowded) Separate(*w);
  EachBlock(0, m.count, [&](int i) { AddCorrection(fluid, p, w->neighbors, i); });
  for (int wall = 0; wall < m.num_walls; ++wall) {
    const WallPairs pairs = PairsOf(*w, wall);
    double* terms = TermsOf(*w, wall);
    EachBlock(0, pairs.count / kLanes, [&](int block) {
      const int k = kLanes * block;
      Collide(fluid, p, pairs, k, [&](const Vec3<Lanes>& change, const Vec3<Lanes>& to, Lanes push) {
        if (kPushes && terms) EachPush(pairs, p.count, k, change, to, push, Writer{terms});
      });
    });
  }
  AddImpulses(*w, m.mass / m.h);
  const float rate = 1.0f / m.h;
  Each(4 * m.count, [&](int i) {
    p.position[i] += p.correction[i];
    p.velocity[i] += rate * p.correction[i];
  });
  Each(4, [&](int k) { p.correction[4 * m.count + k] = 0; });
}

// Applies viscosity, once per step.
inline void SmoothAll(const Environment& w) {
  const Model& m = *w.model;
  const Particles& p = w.particles;
  const FluidConstants fluid = m.fluid;
  for (int pass = 0; pass < m.passes; ++pass) {
    EachBlock(0, m.count, [&](int i) { Smooth(fluid, p, w.neighbors, m.viscosity, i); });
    Each(4 * m.count, [&](int i) { p.velocity[i] += p.correction[i]; });
    for (int wall = 0; wall < m.num_walls; ++wall) {
      const WallPairs pairs = PairsOf(w, wall);
      EachBlock(0, pairs.count / kLanes, [&](int k) { FindWallShare(fluid, p, pairs, kLanes * k); });
      float velocity[3], omega[3];
      WallVelocity(pairs.start, pairs.end, m.h, velocity, omega);
      double* terms = TermsOf(w, wall);
      Each(pairs.count, [&](int k) {
        const int i = pairs.particle[k];
        double change[3] = {0, 0, 0};
        if (i == m.count) return;
        DragAtWall(p, i, pairs.end, velocity, omega, m.viscosity * fluid.rest_density * pairs.share[k], change);
        if (kPushes && terms) DragTerms(p, i, change, terms + 6 * k);
      });
    }
    AddImpulses(w, m.mass);
  }
}

inline void StepEnvironment(Environment* w) {
  const Model& m = *w->model;
  FindPoses(*w);
  Load(*w);
  ShapeGrid(*w);
  const bool fits = w->step->nx * w->step->ny * w->step->nz <= m.most_cells;
  if (!fits) {
    Once([&] { w->step->flags |= kTooManyCells; });
    return;
  }
  PlaceWalls(*w, 0);
  ClearImpulses(*w);
  for (int s = 0; s < m.substeps; ++s) {
    Each(12 * m.num_walls, [&](int k) { w->step->wall_start[k] = w->step->wall_end[k]; });
    PlaceWalls(*w, static_cast<double>(s + 1) / m.substeps);
    Substep(w, m.substeps - 1 - s);
  }
  SmoothAll(*w);
  HandOver(*w);
  Each(m.count, [&](int i) {
    const int target = 3 * w->order[i];
    for (int k = 0; k < 3; ++k) {
      const double x = w->step->origin[k] + w->particles.position[4 * i + k], v = w->particles.velocity[4 * i + k];
      w->positions[target + k] = x;
      w->velocities[target + k] = v;
      if (!(std::fabs(x) < 1e10 && std::fabs(v) < 1e10)) SetBits(&w->step->flags, kNotFinite);
    }
  });
  Once([&] {
    if (w->step->too_many) w->step->flags |= kTooManyNeighbors;
  });
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_STEP_H_
