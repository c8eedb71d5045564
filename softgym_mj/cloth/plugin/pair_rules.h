// Selects pairs that get a row, such that each closest point of two layers has exactly one.

#ifndef SOFTGYM_MJ_CLOTH_PAIR_RULES_H_
#define SOFTGYM_MJ_CLOTH_PAIR_RULES_H_

#include <cmath>
#include <cstdlib>

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {
namespace {

// Edges in flat surfaces, whose normals are within 14 degrees of the pair's, count only if they overlap by more than
// this share of the thickness: otherwise pairs of vertices and triangles suffice.
constexpr float kFlat = 0.97f, kOverlap = 0.1f;
// Pieces of a rope with at most one piece between them touch even in a straight rope, and friction between them would
// lock bending.
constexpr int kNextPieces = 2;
constexpr int kBetweenEnds = 15;  // Region of two edges whose nearest points are not at their ends.

struct PairRules {
  const int* owned;      // Owned features of triangles (Mesh).
  const int* sides;      // The two triangles of each edge, or -1.
  const float* normals;  // Normals of triangles.
  const int* chain;      // Rope of each edge, or -1,
  const int* place;      // and index in it.
  const int* owner;      // Rope edge that owns each vertex.
};

// Computes the normal of a triangle, or zeros if it is degenerate. `position`: four floats per vertex.
inline void FindNormal(const float* position, const int* corner, float* normal) {
  const float *a = position + 4 * corner[0], *b = position + 4 * corner[1], *c = position + 4 * corner[2];
  const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, w[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const float n[3] = {u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]};
  const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (int k = 0; k < 3; ++k) normal[k] = length > 0 ? n[k] / length : 0;
}

// Contact distance [m] of two features of one flex from those of vertices: the larger of the two sides' smallest
// vertex distances, so that slim triangles are thin among themselves only.
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

// Whether an edge's triangles are perpendicular to a direction.
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
      // An end point belongs to the edge that owns it.
      const int only = pair.region & 3 << (k & 2), edge = k < 2 ? pair.first : pair.second;
      if (only == 1 << k && rules.owner[pair.vertex[k]] != edge) return false;
    }
    if (rules.chain[pair.first] != rules.chain[pair.second]) return true;
    return std::abs(rules.place[pair.first] - rules.place[pair.second]) > kNextPieces;
  }
  if (pair.region != kBetweenEnds) return false;  // Pairs of vertices and triangles suffice.
  if (pair.distance < (1 - kOverlap) * thickness) return true;
  return !IsFlat(rules, pair.first, pair.normal) || !IsFlat(rules, pair.second, pair.normal);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PAIR_RULES_H_
