// Area that a triangle mesh covers in top view, layers counted once: `metrics.covered_area` for many meshes.

#ifndef SOFTGYM_MJ_BATCH_COVERED_H_
#define SOFTGYM_MJ_BATCH_COVERED_H_

#include <cmath>
#include <cstring>

#include "batch/group.h"

namespace softgym_mj {
namespace {

// Points (vertices, coordinates), of which the first two coordinates are X and Y [m], and corners (triangles, 3).
struct TriangleMesh {
  long long coordinates, triangles;
  const double* points;
  const long long* corners;
};

// Intersection of a line of constant Y with a triangle.
struct Crossing {
  double left, right;
  bool exists;
};

inline double CrossingAt(double level, double x0, double y0, double x1, double y1) {
  const double height = y1 - y0;
  const double share = (level - y0) / (height > 0 ? height : 1.0);
  return x0 + (x1 - x0) * (share < 0 ? 0.0 : share > 1 ? 1.0 : share);
}

// Intersects line `line` >= 0, at Y = bottom + (line + 1/2) pitch. Corners are sorted stably by Y.
inline Crossing Cross(const TriangleMesh& mesh, long long triangle, double bottom, double pitch, long long line) {
  double x[3], y[3];
  for (int c = 0; c < 3; ++c) {
    const double* point = mesh.points + mesh.coordinates * mesh.corners[3 * triangle + c];
    x[c] = point[0], y[c] = point[1];
  }
  const auto order = [&](int a, int b) {
    if (y[b] >= y[a]) return;
    const double other_x = x[a], other_y = y[a];
    x[a] = x[b], y[a] = y[b];
    x[b] = other_x, y[b] = other_y;
  };
  order(0, 1), order(1, 2), order(0, 1);
  const double first = std::ceil((y[0] - bottom) / pitch - 0.5), end = std::ceil((y[2] - bottom) / pitch - 0.5);
  Crossing found = {0, 0, line >= first && line < end};
  if (!found.exists) return found;
  const double level = bottom + (line + 0.5) * pitch;
  const int a = level < y[1] ? 0 : 1;
  const double whole = CrossingAt(level, x[0], y[0], x[2], y[2]);
  const double part = CrossingAt(level, x[a], y[a], x[a + 1], y[a + 1]);
  found.left = whole < part ? whole : part;
  found.right = whole < part ? part : whole;
  return found;
}

constexpr int kMostPieces = 96;  // Disjoint pieces of a line; piles have a dozen.

// Covered length of a line for any number of pieces: each counts beyond the ends of all earlier ones.
inline double CoveredOfMany(const TriangleMesh& mesh, double bottom, double pitch, long long line) {
  double covered = 0;
  for (long long t = 0; t < mesh.triangles; ++t) {
    const Crossing own = Cross(mesh, t, bottom, pitch, line);
    if (!own.exists) continue;
    double from = own.left;
    for (long long u = 0; u < mesh.triangles; ++u) {
      const Crossing other = Cross(mesh, u, bottom, pitch, line);
      const bool before = other.left < own.left || (other.left == own.left && u < t);
      if (other.exists && before && other.right > from) from = other.right;
    }
    if (own.right > from) covered += own.right - from;
  }
  return covered;
}

inline double Covered(const TriangleMesh& mesh, double bottom, double pitch, long long line) {
  double left[kMostPieces], right[kMostPieces];
  int pieces = 0;
  for (long long t = 0; t < mesh.triangles; ++t) {
    Crossing own = Cross(mesh, t, bottom, pitch, line);
    if (!own.exists) continue;
    for (int i = 0; i < pieces;) {
      if (own.left > right[i] || own.right < left[i]) {
        ++i;
        continue;
      }
      // They merge into one piece, which may overlap earlier ones.
      own.left = own.left < left[i] ? own.left : left[i];
      own.right = own.right > right[i] ? own.right : right[i];
      --pieces;
      left[i] = left[pieces], right[i] = right[pieces];
      i = 0;
    }
    if (pieces == kMostPieces) return CoveredOfMany(mesh, bottom, pitch, line);
    left[pieces] = own.left, right[pieces++] = own.right;
  }
  double covered = 0;
  for (int i = 0; i < pieces; ++i) covered += right[i] - left[i];
  return covered;
}

// Integer key with the order of the doubles.
inline Key KeyOf(double a) {
  Key bits;
  memcpy(&bits, &a, sizeof(bits));
  return bits >> 63 ? ~bits : bits | Key{1} << 63;
}
inline double FromKey(Key key) {
  const Key bits = key >> 63 ? key & ~(Key{1} << 63) : ~key;
  double a;
  memcpy(&a, &bits, sizeof(a));
  return a;
}

// Computes `area` [m^2]; `lengths`: memory for a number per line.
inline void CoverMesh(const TriangleMesh& mesh, long long lines, double* lengths, double* area) {
  SGM_SHARED Key ends[2];
  Once([&] { ends[0] = ends[1] = ~Key{0}; });
  Each(static_cast<int>(3 * mesh.triangles), [&](int i) {
    const Key key = KeyOf(mesh.points[mesh.coordinates * mesh.corners[i] + 1]);
    TakeLeast(&ends[0], key);
    TakeLeast(&ends[1], ~key);
  });
  const double bottom = FromKey(ends[0]), pitch = (FromKey(~ends[1]) - bottom) / static_cast<double>(lines);
  Each(static_cast<int>(lines), [&](int line) { lengths[line] = pitch > 0 ? Covered(mesh, bottom, pitch, line) : 0; });
  Once([&] {
    double sum = 0;
    for (long long line = 0; line < lines; ++line) sum += lengths[line];
    *area = sum * pitch;
  });
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_COVERED_H_
