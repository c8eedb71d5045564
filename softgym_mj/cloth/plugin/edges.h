// Of one edge and of one cord: what every solver of them does.

#ifndef SOFTGYM_MJ_CLOTH_EDGES_H_
#define SOFTGYM_MJ_CLOTH_EDGES_H_

#include <cmath>

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {
namespace {

// Fills `way` from vertex b to vertex a of (n, 3) at the start of the step; returns its length [m].
inline float StartWay(const double* position, int a, int b, float way[3]) {
  float square = 0;
  for (int k = 0; k < 3; ++k) {
    way[k] = static_cast<float>(position[3 * a + k] - position[3 * b + k]);
    square += way[k] * way[k];
  }
  return std::sqrt(square);
}

// The length now of what was `way` at the start of the step [m].
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

// Rows of a cord of `size` edges: a number or three of each, as in EdgeBlock; `vertex` has one more. Then memory for
// the system that they form.
struct ChainRow {
  int size;
  const int* vertex;
  const float *start, *length, *gamma, *keep;
  float *before, *impulse;
  double *lower, *diagonal, *right, *normal;
};

// The edges form a tridiagonal system (Thomas' algorithm).
inline void SolveChain(const Points& points, const ChainRow& row) {
  double* n = row.normal;
  for (int e = 0; e < row.size; ++e) {
    const float *a = points.now + 4 * row.vertex[e], *b = points.now + 4 * row.vertex[e + 1];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      n[3 * e + k] = static_cast<double>(row.start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += n[3 * e + k] * n[3 * e + k];
    }
    const double root = std::sqrt(square), now = root > 1e-9 ? root : 1e-9;
    for (int k = 0; k < 3; ++k) n[3 * e + k] /= now;
    const double length = row.length[e];
    double diagonal = static_cast<double>(a[3]) + b[3] + row.gamma[e];
    double right = -((now - length) - row.keep[e] * (row.before[e] - length));
    row.lower[e] = 0;
    if (e > 0) {
      const double* m = n + 3 * e - 3;
      const double side = -a[3] * (m[0] * n[3 * e] + m[1] * n[3 * e + 1] + m[2] * n[3 * e + 2]);
      const double ratio = side / row.diagonal[e - 1];
      diagonal -= ratio * side;
      right -= ratio * row.right[e - 1];
      row.lower[e] = side;
    }
    row.diagonal[e] = diagonal;
    row.right[e] = right;
  }
  double impulse = 0;
  for (int i = row.size; i-- > 0;) {
    const double side = i + 1 < row.size ? row.lower[i + 1] : 0;
    impulse = (row.right[i] - side * impulse) / row.diagonal[i];
    row.impulse[i] = static_cast<float>(impulse);
    float *a = points.now + 4 * row.vertex[i], *b = points.now + 4 * row.vertex[i + 1];
    for (int k = 0; k < 3; ++k) {
      a[k] = static_cast<float>(a[k] - a[3] * impulse * n[3 * i + k]);
      b[k] = static_cast<float>(b[k] + b[3] * impulse * n[3 * i + k]);
    }
  }
  for (int e = 0; e < row.size; ++e) {
    const float *a = points.now + 4 * row.vertex[e], *b = points.now + 4 * row.vertex[e + 1];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = static_cast<double>(row.start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += d * d;
    }
    row.before[e] = static_cast<float>(std::sqrt(square));
  }
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_EDGES_H_
