// Which of the pairs that may touch get a row: each closest point of two layers has one.

#ifndef SOFTGYM_MJ_CLOTH_PAIR_RULES_H_
#define SOFTGYM_MJ_CLOTH_PAIR_RULES_H_

#include <cmath>
#include <cstdlib>

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {
namespace {

// Edges in flat surfaces, whose normals are within 14 degrees of the pair's, count only if they overlap by more than
// this share of the thickness: vertices and triangles do their work.
constexpr float kFlat = 0.97f, kOverlap = 0.1f;
// Pieces of a rope with at most one piece between them are as near as their thickness when it is straight: friction
// between them would lock its bending.
constexpr int kNextPieces = 2;
constexpr int kBetweenEnds = 15;  // Region of two edges whose nearest points are not at their ends.

struct PairRules {
  const int* owned;      // Of triangles: see Mesh.
  const int* sides;      // The two triangles of each edge, or -1.
  const float* normals;  // Of triangles.
  const int* chain;      // Of each edge: the rope that it belongs to, or -1,
  const int* place;      // and where.
  const int* owner;      // Of each vertex: the edge of a rope that it is counted with.
};

// Fills the normal of a triangle, or zeros. `position`: four floats a vertex.
inline void FindNormal(const float* position, const int* corner, float* normal) {
  const float *a = position + 4 * corner[0], *b = position + 4 * corner[1], *c = position + 4 * corner[2];
  const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, w[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const float n[3] = {u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]};
  const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (int k = 0; k < 3; ++k) normal[k] = length > 0 ? n[k] / length : 0;
}

// Distance [m] at which two features of one flex touch, from that of each vertex. A side is as thin as its thinnest
// vertex; where the two sides differ, the thicker one has room for its distance: slim triangles are thin among
// themselves only.
inline float Thickness(const float* of_vertex, const Pair& pair) {
  float side[2] = {of_vertex[pair.vertex[0]], of_vertex[pair.vertex[3]]};
  for (int k = 1; k < 3; ++k) {
    float& least = side[k > pair.edges];
    const float other = of_vertex[pair.vertex[k]];
    least = other < least ? other : least;
  }
  return side[0] > side[1] ? side[0] : side[1];
}

inline bool AreRopes(const PairRules& rules, const Pair& pair) {
  return rules.chain[pair.first] >= 0 && rules.chain[pair.second] >= 0;
}

// Whether an edge's triangles lie across a direction.
inline bool IsFlat(const PairRules& rules, int edge, const float* normal) {
  const int* sides = rules.sides + 2 * edge;
  for (int k = 0; k < 2; ++k) {
    if (sides[k] < 0) continue;
    const float* n = rules.normals + 3 * sides[k];
    if (std::fabs(n[0] * normal[0] + n[1] * normal[1] + n[2] * normal[2]) < kFlat) return false;
  }
  return sides[0] >= 0;
}

inline bool Counts(const PairRules& rules, const Pair& pair, float thickness) {
  if (!pair.edges) return rules.owned[pair.second] >> pair.region & 1;
  if (AreRopes(rules, pair)) {
    for (int k = 0; k < 4; ++k) {
      // At an end: of the edge that owns it.
      const int only = pair.region & 3 << (k & 2), edge = k < 2 ? pair.first : pair.second;
      if (only == 1 << k && rules.owner[pair.vertex[k]] != edge) return false;
    }
    if (rules.chain[pair.first] != rules.chain[pair.second]) return true;
    return std::abs(rules.place[pair.first] - rules.place[pair.second]) > kNextPieces;
  }
  if (pair.region != kBetweenEnds) return false;  // Vertices and triangles do its work.
  if (pair.distance < (1 - kOverlap) * thickness) return true;
  return !IsFlat(rules, pair.first, pair.normal) || !IsFlat(rules, pair.second, pair.normal);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PAIR_RULES_H_
