// Step of one environment, bit-identical to that of `Solver`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_STEP_H_
#define SOFTGYM_MJ_CLOTH_BATCH_STEP_H_

#include "cloth/batch/environment.h"
#include "cloth/batch/finish.h"
#include "cloth/batch/layers.h"
#include "cloth/batch/plane.h"
#include "cloth/batch/springs.h"
#include "cloth/batch/touch.h"
#include "cloth/batch/touch_results.h"
#include "cloth/batch/twists.h"
#include "cloth/plugin/drag.h"
#include "cloth/plugin/sweeps.h"

namespace softgym_mj::cloth {
namespace {

// Initializes the state between steps unless it is valid.
inline void InitializeFresh(const Environment& w) {
  const Model& m = *w.model;
  const bool fresh = *w.valid != 1;
  Wait();
  if (!fresh) return;
  Each(m.vertices, [&](int v) {
    for (int k = 0; k < 3; ++k) w.reference[3 * v + k] = w.start[3 * v + k];
    w.holding_force[v] = 0;
    for (int k = 0; k < 4 * kKeptPairs; ++k) w.after_layers[4 * kKeptPairs * v + k] = 0;
  });
  Each(m.edges, [&](int e) { w.after_edge[e] = 0; });
  Each(Solids(m) > 0 ? kNumSides : 0, [&](int i) { w.sides[i] = 0; });
  Once([&] { *w.valid = 1; });
}

// Gathers positions, velocities and masses.
inline void Gather(const Environment& w) {
  const Model& m = *w.model;
  const double dt = m.timestep;
  const double* origin = m.At<double>(m.origin_at);
  const float* inverse_mass = m.At<float>(m.inverse_mass_at);
  Each(3 * m.grippers, [&](int i) { w.gripper_qvel[i] = (w.targets[i] - w.gripper_qpos[i]) / dt; });
  Once([&] {
    w.step->flags = w.step->num_driven = 0;
    w.step->fastest = 0;
    for (int g = 0; g < m.grippers; ++g) {
      const int v = w.held[g];
      if (v < 0) continue;
      for (int k = 0; k < 3; ++k) w.qvel[3 * v + k] = (w.goals[3 * g + k] - origin[3 * v + k] - w.qpos[3 * v + k]) / dt;
      w.driven[w.step->num_driven++] = v;
    }
  });
  Each(m.padded, [&](int v) {
    w.inverse_mass[v] = w.yielding[v] = inverse_mass[v];
    w.plane_gap[v] = kNoPlane;
    w.plane_friction[v] = 0;
    // Elements with two corners read a third, unused one.
    for (int k = 0; k < 4; ++k) w.solid_position[4 * v + k] = 0;
  });
  Each(m.grippers, [&](int g) {
    const int v = w.held[g];
    if (v < 0) return;
    w.inverse_mass[v] = 0;
    w.yielding[v] = static_cast<float>(1 / m.At<double>(m.mass_at)[v]);
  });
  Each(m.vertices, [&](int v) {
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = 3 * v + k;
      w.start[i] = origin[i] + w.qpos[i];
      w.velocity[i] = w.qvel[i];
      const double after = w.qvel[i] + dt * m.gravity[k];
      w.acceleration[i] = w.inverse_mass[v] > 0 ? (after - w.qvel[i]) / dt : 0;
      w.solid_position[4 * v + k] = static_cast<float>(w.start[i]);
      square += w.velocity[i] * w.velocity[i];
      w.forces[i] = 0;
    }
    const double way = dt * std::sqrt(square);
    w.solid_position[4 * v + 3] = static_cast<float>(way);
    TakeLargest(&w.step->fastest, way);
  });
}

inline void StartPoints(const Environment& w) {
  const Model& m = *w.model;
  const double h = m.h;
  const int *corners = m.At<int>(m.triangle_vertex_at), *first = m.At<int>(m.triangles_of_at);
  const int* around = m.At<int>(m.triangle_of_at);
  const double* area = m.At<double>(m.triangle_area_at);
  const bool drags = m.drag > 0;
  Each(drags ? m.triangles : 0, [&](int t) {
    Vector n = {0, 0, 0};
    double damped = 0;
    if (area[t] > 0) {
      damped = Drag(w.start, w.velocity, w.acceleration, corners + 3 * t, area[t], m.density, m.drag, m.timestep, &n);
    }
    w.drag[4 * t] = damped, w.drag[4 * t + 1] = n.x, w.drag[4 * t + 2] = n.y, w.drag[4 * t + 3] = n.z;
  });
  Each(m.padded, [&](int v) {
    const bool is_vertex = v < m.vertices;
    const float mass = is_vertex ? w.inverse_mass[v] : 0;
    double acceleration[3] = {0, 0, 0};
    for (int k = 0; is_vertex && k < 3; ++k) acceleration[k] = w.acceleration[3 * v + k];
    for (int i = drags && mass > 0 ? first[v] : 0; drags && mass > 0 && i < first[v + 1]; ++i) {
      const double *triangle = w.drag + 4 * around[i], change = -triangle[0] / 3 * mass;
      for (int k = 0; k < 3; ++k) acceleration[k] += change * triangle[1 + k];
    }
    for (int k = 0; k < 3; ++k) {
      const int i = 4 * v + k;
      w.points.now[i] = 0;
      w.points.before[i] = is_vertex ? static_cast<float>(-h * w.velocity[3 * v + k]) : 0;
      w.points.drift[i] = w.points.bent_drift[i] = mass > 0 ? static_cast<float>(h * h * acceleration[k]) : 0;
    }
    w.points.now[4 * v + 3] = w.points.before[4 * v + 3] = mass;
    w.points.drift[4 * v + 3] = w.points.bent_drift[4 * v + 3] = 0;
  });
}

// Starts air drag, as `StartAir`.
inline void StartAirOf(const Environment& w) {
  const Model& m = *w.model;
  if (!m.takes_air) return;
  float* air = w.points.air;
  const int *corners = m.At<int>(m.triangle_vertex_at), *first = m.At<int>(m.triangles_of_at);
  const int* around = m.At<int>(m.triangle_of_at);
  const double* area = m.At<double>(m.triangle_area_at);
  Each(m.triangles, [&](int t) {
    const int* v = corners + 3 * t;
    const Vector a = FromArray(w.start + 3 * v[0]), b = FromArray(w.start + 3 * v[1]);
    const Vector n = Cross(b - a, FromArray(w.start + 3 * v[2]) - a);
    w.drag[4 * t + 1] = n.x, w.drag[4 * t + 2] = n.y, w.drag[4 * t + 3] = n.z;
  });
  Each(m.padded, [&](int v) {
    float n[3] = {0, 0, 0};
    for (int i = v < m.vertices ? first[v] : 0; v < m.vertices && i < first[v + 1]; ++i) {
      for (int k = 0; k < 3; ++k) n[k] += static_cast<float>(w.drag[4 * around[i] + 1 + k]);
    }
    for (int k = 0; k < 4; ++k) air[4 * v + k] = k < 3 ? n[k] : 0;
    if (v < m.vertices) w.touches[v] = w.plane_gap[v] < kTouching * m.radius;
  });
  Each(w.step->num_pairs, [&](int i) {
    const Pair& pair = w.pairs[i];
    if (pair.distance > (1 + kTouching) * ThicknessOf(m, pair)) return;
    for (int k = 0; k < 4; ++k) {
      if (IsAcross(pair, air + 4 * pair.vertex[k])) SetBits(&w.touches[pair.vertex[k]], 1);
    }
  });
  Each(m.vertices, [&](int v) {
    float* n = air + 4 * v;
    double of_vertex = 0;
    for (int i = first[v]; i < first[v + 1]; ++i) of_vertex += area[around[i]] / 3;
    const double taken = m.added_mass * of_vertex;
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const bool moves = !w.touches[v] && w.inverse_mass[v] > 0 && length > 0;
    const double mass = m.At<double>(m.mass_at)[v];
    const float scale = moves ? static_cast<float>(std::sqrt(taken / (mass + taken))) / length : 0;
    for (int k = 0; k < 3; ++k) n[k] *= scale;
  });
}

// Calls `sweep` with held vertices of a surface released, so that both sides are pushed, as `Driven::TwoWayPass`.
template <class F>
inline void TwoWayPass(const Environment& w, F sweep) {
  Each(w.step->num_driven, [&](int i) {
    const int v = w.driven[i];
    w.points.now[4 * v + 3] = w.yielding[v];
    for (int k = 0; k < 3; ++k) w.place[3 * i + k] = w.points.now[4 * v + k];
  });
  sweep();
  Each(w.step->num_driven, [&](int i) {
    const int v = w.driven[i];
    w.points.now[4 * v + 3] = 0;
    for (int k = 0; k < 3; ++k) {
      const float way = w.points.now[4 * v + k] - w.place[3 * i + k];
      w.points.before[4 * v + k] += way;
      w.given[3 * i + k] += way;
    }
  });
}

// Applies a share of the impulses of the last substep near light bodies.
inline void WarmContacts(const Environment& w) {
  TwoWayPass(w, [&] { EachLayer(w, true, [&](LayerBlock* block) { WarmLayers(w.points, block, kWarm); }); });
  WarmTouches(w);
  TwoWayPass(w, [&] {
    EachPlaneBlock(w, true, [&](const Plane& plane, int first) { WarmPlane(w.points, plane, first, kWarm); });
  });
}

// Sweeps vertices near bodies against the floor.
inline void SweepNearPlane(const Environment& w, SweepPass pass) {
  if (!TouchesBodies(w)) return;
  EachPlaneBlock(w, true,
                 [&](const Plane& near, int first) { SweepPlane(w.points, w.model->plane_row, near, first, pass); });
}

inline void Substep(const Environment& w, int substep, int search_interval) {
  const Model& m = *w.model;
  const int blocks = m.padded / kBlock;
  const bool warm = kSolids && w.step->touches_light && substep > 0, repeats = kSolids && w.step->repeats;
  const SweepPass once = {true, true}, pass = {!warm, !repeats};
  PushTwist(w);
  Bend(w, substep);
  EachBlock(0, 4 * m.padded / kLanes, [&](int i) { Move(w.points, kLanes * i); });
  const int left = m.substeps - substep, to_search = search_interval < left ? search_interval : left;
  MoveBodies(w);
  FindTouches(w, substep % search_interval == 0 ? to_search : 0);
  SweepSprings(w);
  if (m.takes_air) EachBlock(0, blocks, [&](int b) { MoveAir(w.points, kBlock * b); });
  if (warm) WarmContacts(w);
  TwoWayPass(w, [&] {
    EachLayer(w, true, [&](LayerBlock* block) { SweepLayers(w.points, m.contact, block, pass); });
    EachLayer(w, false, [&](LayerBlock* block) { SweepLayers(w.points, m.contact, block, once); });
  });
  if (substep + 1 == m.substeps) Each(4 * m.padded, [&](int i) { w.with_layers[i] = w.points.now[i]; });
  SweepTouches(w, pass);
  TwoWayPass(w, [&] {
    EachPlaneBlock(w, false,
                   [&](const Plane& plane, int first) { SweepPlane(w.points, m.plane_row, plane, first, once); });
    SweepNearPlane(w, pass);
  });
  if (repeats) ListPushing(w);
  for (int sweep = 1; repeats && sweep < m.sweeps; ++sweep) {
    const SweepPass again = {false, sweep + 1 == m.sweeps};
    SweepTouches(w, again);
    TwoWayPass(w, [&] {
      EachPushing(w, [&](LayerBlock* block) { SweepLayers(w.points, m.contact, block, again); });
      SweepNearPlane(w, again);
    });
  }
  FinishBodies(w);
  AddHoldingForces(w, 1 / (m.h * m.h * m.substeps));
}

inline void StepEnvironment(const Environment& w) {
  const Model& m = *w.model;
  Gather(w);
  InitializeFresh(w);
  StartTouches(w);
  FollowReference(w);
  FindPairs(w);
  MakeLayerRows(w);
  StartPoints(w);
  StartSprings(w);
  StartTwist(w);
  StartPlane(w);
  StartAirOf(w);
  Each(3 * w.step->num_driven, [&](int i) { w.given[i] = 0; });
  const int search_interval = SearchInterval(w.step->fastest, m.substeps);
  for (int substep = 0; substep < m.substeps; ++substep) Substep(w, substep, search_interval);
  SumForces(w);
  WriteImpulses(w);
  SolveChains(w, true);
  EndChains(w);
  KeepLayers(w);
  KeepSprings(w);
  Each(m.vertices, [&](int v) {
    const double* f = w.forces + 3 * v;
    w.holding_force[v] = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  });
  FinishMotion(w);
  KeepSides(w);
  FindPushes(w);
  EndTwist(w);
  Each(3 * m.vertices, [&](int i) {
    w.qvel[i] = w.speed[i];
    w.qpos[i] += w.motion[i];
    if (!(std::fabs(w.qpos[i]) < 1e10 && std::fabs(w.qvel[i]) < 1e10)) SetBits(&w.step->flags, kNotFinite);
  });
  Each(3 * m.grippers, [&](int i) { w.gripper_qpos[i] += m.timestep * w.gripper_qvel[i]; });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_STEP_H_
