// Twist of a rope, as `TwistRows`.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_TWISTS_H_
#define SOFTGYM_MJ_CLOTH_BATCH_TWISTS_H_

#include "cloth/batch/environment.h"
#include "cloth/plugin/twist.h"

namespace softgym_mj::cloth {
namespace {

inline TwistRow TwistOf(const Environment& w) {
  const Model& m = *w.model;
  return {m.chain_edges,  m.twist_ring != 0, m.At<int>(m.chain_vertex_at), m.twist, w.twist, w.twist_way, w.twist_next,
          w.twist_change, w.twist_pull};
}

// Whether a rope twists in this step: both of its ends are held.
inline bool IsTwisting(const Environment& w) {
  const Model& m = *w.model;
  if (!(m.twist > 0)) return false;
  const int* vertex = m.At<int>(m.chain_vertex_at);
  return m.twist_clamped || (w.inverse_mass[vertex[0]] == 0 && w.inverse_mass[vertex[m.chain_edges]] == 0);
}

SGM_APART void StartTwist(const Environment& w) {
  if (!IsTwisting(w)) {
    if (w.model->twist > 0) Once([&] { *w.twist = 0; });
    return;
  }
  const TwistRow row = TwistOf(w);
  Each(row.size, [&](int e) { StartTwistEdge(w.start, row, e); });
}

SGM_APART void PushTwist(const Environment& w) {
  if (!IsTwisting(w)) return;
  const TwistRow row = TwistOf(w);
  Each(row.size, [&](int e) { FollowTwistEdge(w.start, w.points, row, e); });
  Each(row.size, [&](int i) { TurnTwistVertex(row, i); });
  Once([&] { AddTwist(row); });
  Each(row.size, [&](int e) { PullTwistEdge(row, e); });
  Each(row.size, [&](int e) { KeepTwistEdge(row, e); });
  Each(TwistVertices(row), [&](int i) { PushTwistVertex(w.points, row, i, w.model->h); });
}

SGM_APART void EndTwist(const Environment& w) {
  if (!IsTwisting(w)) return;
  const TwistRow row = TwistOf(w);
  Each(row.size, [&](int e) { EndTwistEdge(w.start, w.motion, row, e); });
  Each(row.size, [&](int i) { TurnTwistVertex(row, i); });
  Once([&] { AddTwist(row); });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_TWISTS_H_
