#include "cloth/plugin/twists.h"

#include "cloth/plugin/twist.h"

namespace softgym_mj::cloth {
namespace {

TwistRow View(TwistRows::Rope* rope) {
  return {static_cast<int>(rope->vertex.size()) - 1,
          rope->is_ring,
          rope->vertex.data(),
          rope->stiffness,
          rope->angle,
          rope->way.data(),
          rope->next.data(),
          rope->change.data(),
          rope->pull.data()};
}

}  // namespace

void TwistRows::Reset(const Mesh& mesh, double h) {
  h_ = h;
  ropes_.clear();
  for (const Mesh::Chain& chain : mesh.chains) {
    const int part = mesh.part[chain.vertex[0]];
    const Material& material = mesh.materials[part];
    if (!(material.twist > 0)) continue;
    Rope rope;
    rope.part = part;
    rope.is_ring = chain.IsRing();
    rope.is_clamped = material.twist_clamped || rope.is_ring;
    rope.vertex = chain.vertex;
    const size_t size = chain.edge.size();
    // The rope twists between the middles of its first and last edge, whose frames the ends have.
    double length = 0;
    for (int e : chain.edge) length += mesh.edges[e].length;
    if (!rope.is_ring) length -= (mesh.edges[chain.edge[0]].length + mesh.edges[chain.edge[size - 1]].length) / 2;
    rope.stiffness = length > 0 ? material.twist / length : 0;
    for (auto* a : {&rope.way, &rope.next, &rope.pull}) a->resize(3 * size);
    rope.change.resize(size);
    ropes_.push_back(rope);
  }
}

void TwistRows::Start(const cloth::Start& start, double* angles) {
  position_ = start.position.data();
  for (Rope& rope : ropes_) {
    const auto is_held = [&](int v) { return start.inverse_mass[v] == 0 && !start.rides[v]; };
    const bool holds = rope.is_clamped || (is_held(rope.vertex.front()) && is_held(rope.vertex.back()));
    rope.angle = holds ? angles + rope.part : nullptr;
    if (!holds) angles[rope.part] = 0;
    const TwistRow row = View(&rope);
    for (int e = 0; holds && e < row.size; ++e) StartTwistEdge(position_, row, e);
  }
}

void TwistRows::Push(const Points& points) {
  for (Rope& rope : ropes_) {
    if (!rope.angle) continue;
    const TwistRow row = View(&rope);
    for (int e = 0; e < row.size; ++e) FollowTwistEdge(position_, points, row, e);
    for (int i = 0; i < row.size; ++i) TurnTwistVertex(row, i);
    AddTwist(row);
    for (int e = 0; e < row.size; ++e) PullTwistEdge(row, e), KeepTwistEdge(row, e);
    for (int i = 0; i < TwistVertices(row); ++i) PushTwistVertex(points, row, i, h_);
  }
}

void TwistRows::End(const cloth::Start& start, const Motion& motion) {
  for (Rope& rope : ropes_) {
    if (!rope.angle) continue;
    const TwistRow row = View(&rope);
    for (int e = 0; e < row.size; ++e) EndTwistEdge(start.position.data(), motion.move.data(), row, e);
    for (int i = 0; i < row.size; ++i) TurnTwistVertex(row, i);
    AddTwist(row);
  }
}

}  // namespace softgym_mj::cloth
