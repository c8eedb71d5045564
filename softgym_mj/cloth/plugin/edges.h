// Computations for one edge and one rope, shared by all solvers.

#ifndef SOFTGYM_MJ_CLOTH_EDGES_H_
#define SOFTGYM_MJ_CLOTH_EDGES_H_

#include <cmath>

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {
namespace {

// Computes the vector `way` from vertex b to vertex a at the start of the step; returns its length [m].
inline float StartWay(const double* position, int a, int b, float way[3]) {
  float square = 0;
  for (int k = 0; k < 3; ++k) {
    way[k] = static_cast<float>(position[3 * a + k] - position[3 * b + k]);
    square += way[k] * way[k];
  }
  return std::sqrt(square);
}

// Current length [m] of an edge that was `way` at the start of the step.
inline float LengthNow(const Points& points, int a, int b, const float way[3]) {
  float square = 0;
  for (int k = 0; k < 3; ++k) {
    const float d = way[k] + (points.now[4 * a + k] - points.now[4 * b + k]);
    square += d * d;
  }
  return std::sqrt(square);
}

// Adds a force [N] along `way` to another one.
inline void AddForce(const float way[3], double force, double* sum) {
  double length = 0;
  for (int k = 0; k < 3; ++k) length += static_cast<double>(way[k]) * way[k];
  length = std::sqrt(length);
  length = length > 1e-9 ? length : 1e-9;
  for (int k = 0; k < 3; ++k) sum[k] += force * way[k] / length;
}

// Rows of a rope of `size` edges: one or three numbers per edge, as in EdgeBlock; `vertex` has one more entry. Then
// memory for their linear system.
struct ChainRow {
  int size;
  const int* vertex;
  const float *start, *length, *gamma, *keep;
  float *before, *impulse;
  double *lower, *diagonal, *right, *normal;
};

// The edges form a tridiagonal system, solved by Thomas' algorithm. Step 1: coefficients of each edge.
inline void StartChainEdge(const Points& points, const ChainRow& row, int e, bool settles) {
  double* n = row.normal + 3 * e;
  const float *a = points.now + 4 * row.vertex[e], *b = points.now + 4 * row.vertex[e + 1];
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    n[k] = static_cast<double>(row.start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
    square += n[k] * n[k];
  }
  const double root = std::sqrt(square), now = root > 1e-9 ? root : 1e-9;
  for (int k = 0; k < 3; ++k) n[k] /= now;
  const double length = row.length[e];
  row.diagonal[e] = static_cast<double>(a[3]) + b[3] + row.gamma[e];
  row.right[e] = settles ? row.before[e] - now : -((now - length) - row.keep[e] * (row.before[e] - length));
}

// Step 2: coupling of each edge with its predecessor.
inline void ConnectChainEdge(const Points& points, const ChainRow& row, int e) {
  const double *n = row.normal + 3 * e, *m = n - 3;
  row.lower[e] = e > 0 ? -points.now[4 * row.vertex[e] + 3] * (m[0] * n[0] + m[1] * n[1] + m[2] * n[2]) : 0;
}

// Step 3: forward elimination and back substitution.
inline void SolveChain(const ChainRow& row) {
  double diagonal = 1, right = 0;
  for (int e = 0; e < row.size; ++e) {
    const double side = row.lower[e], ratio = side / diagonal;
    diagonal = row.diagonal[e] - ratio * side;
    right = row.right[e] - ratio * right;
    row.diagonal[e] = diagonal;
    row.right[e] = right;
  }
  double impulse = 0, side = 0;
  for (int e = row.size; e-- > 0;) {
    impulse = (row.right[e] - side * impulse) / row.diagonal[e];
    row.right[e] = impulse;
    side = row.lower[e];
  }
}

// Step 4: displacement of each vertex.
inline void MoveChainVertex(const Points& points, const ChainRow& row, int i, bool settles) {
  float *p = points.now + 4 * row.vertex[i], *before = points.before + 4 * row.vertex[i];
  for (int k = 0; k < 3; ++k) {
    const float from = p[k];
    if (i < row.size) p[k] = static_cast<float>(p[k] - p[3] * row.right[i] * row.normal[3 * i + k]);
    if (i > 0) p[k] = static_cast<float>(p[k] + p[3] * row.right[i - 1] * row.normal[3 * i - 3 + k]);
    if (settles) before[k] += p[k] - from;
  }
}

// Step 5: final length and impulse of each edge.
inline void EndChainEdge(const Points& points, const ChainRow& row, int e) {
  const float *a = points.now + 4 * row.vertex[e], *b = points.now + 4 * row.vertex[e + 1];
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    const double d = static_cast<double>(row.start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
    square += d * d;
  }
  row.before[e] = static_cast<float>(std::sqrt(square));
  row.impulse[e] = static_cast<float>(row.right[e]);
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_EDGES_H_
