// Area that a triangle mesh covers in top view, layers counted once: `metrics.covered_area` for many meshes.

#ifndef SOFTGYM_MJ_BATCH_COVERED_H_
#define SOFTGYM_MJ_BATCH_COVERED_H_

#include <cmath>
#include <cstring>
#ifndef __CUDACC__
#include <algorithm>
#include <vector>
#endif

#include "batch/group.h"

namespace softgym_mj {
namespace {

// Points (vertices, coordinates), of which the first two coordinates are X and Y [m], and corners (triangles, 3).
struct TriangleMesh {
  long long coordinates, triangles;
  const double* points;
  const long long* corners;
};

// Line `line` lies at Y = bottom + (line + 1/2) pitch.
struct Lines {
  double bottom, pitch;

  // The first line that is not below a height: a whole number of any size.
  double From(double y) const { return std::ceil((y - bottom) / pitch - 0.5); }
};

// Corners of a triangle, sorted stably by Y.
struct Corners {
  double x[3], y[3];
};

inline Corners CornersOf(const TriangleMesh& mesh, long long triangle) {
  Corners own;
  for (int c = 0; c < 3; ++c) {
    const double* point = mesh.points + mesh.coordinates * mesh.corners[3 * triangle + c];
    own.x[c] = point[0], own.y[c] = point[1];
  }
  const auto order = [&](int a, int b) {
    if (own.y[b] >= own.y[a]) return;
    const double x = own.x[a], y = own.y[a];
    own.x[a] = own.x[b], own.y[a] = own.y[b];
    own.x[b] = x, own.y[b] = y;
  };
  order(0, 1), order(1, 2), order(0, 1);
  return own;
}

// Intersection of a line with a triangle.
struct Crossing {
  double left, right;
};

inline double CrossingAt(double level, double x0, double y0, double x1, double y1) {
  const double height = y1 - y0;
  const double share = (level - y0) / (height > 0 ? height : 1.0);
  return x0 + (x1 - x0) * (share < 0 ? 0.0 : share > 1 ? 1.0 : share);
}

inline Crossing Cross(const Lines& lines, long long line, const Corners& own) {
  const double level = lines.bottom + (line + 0.5) * lines.pitch;
  const int a = level < own.y[1] ? 0 : 1;
  const double whole = CrossingAt(level, own.x[0], own.y[0], own.x[2], own.y[2]);
  const double part = CrossingAt(level, own.x[a], own.y[a], own.x[a + 1], own.y[a + 1]);
  return {whole < part ? whole : part, whole < part ? part : whole};
}

constexpr int kMostPieces = 96;  // Disjoint pieces of a line; piles have a dozen.

// Covered length of a line for any number of pieces: each counts beyond the ends of all earlier ones. `each(f)` calls
// f(crossing) for the line's intersections, in the order of the triangles.
template <class F>
inline double CoveredOfMany(F each) {
  double covered = 0;
  int number = 0;
  each([&](const Crossing& own) {
    double from = own.left;
    int other_number = 0;
    each([&](const Crossing& other) {
      const bool before = other.left < own.left || (other.left == own.left && other_number < number);
      if (before && other.right > from) from = other.right;
      ++other_number;
    });
    if (own.right > from) covered += own.right - from;
    ++number;
  });
  return covered;
}

template <class F>
inline double Covered(F each) {
  double left[kMostPieces], right[kMostPieces];
  int pieces = 0;
  bool full = false;
  each([&](Crossing own) {
    for (int i = 0; !full && i < pieces;) {
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
    full = full || pieces == kMostPieces;
    if (!full) left[pieces] = own.left, right[pieces++] = own.right;
  });
  if (full) return CoveredOfMany(each);
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

#ifdef __CUDACC__

inline void CoverLines(const TriangleMesh& mesh, const Lines& lines, int count, double* lengths) {
  Each(count, [&](int line) {
    lengths[line] = Covered([&](auto f) {
      for (long long t = 0; t < mesh.triangles; ++t) {
        const Corners own = CornersOf(mesh, t);
        if (line >= lines.From(own.y[0]) && line < lines.From(own.y[2])) f(Cross(lines, line, own));
      }
    });
  });
}

#else

// Intersections of all lines, line after line, in the order of the triangles.
struct Crossings {
  std::vector<int> begin;
  std::vector<Crossing> all;
};

inline Crossings CrossingsOf(const TriangleMesh& mesh, const Lines& lines, int count) {
  Crossings found = {std::vector<int>(count + 2), {}};
  const auto each = [&](auto f) {
    for (long long t = 0; t < mesh.triangles; ++t) {
      const Corners own = CornersOf(mesh, t);
      const double first = lines.From(own.y[0]), end = lines.From(own.y[2]);
      if (!(first < count)) continue;
      for (int line = static_cast<int>(first); line < count && line < end; ++line) f(line, own);
    }
  };
  // Line i ends at begin[i + 2] before the second loop, and at begin[i + 1] after it.
  each([&](int line, const Corners&) { ++found.begin[line + 2]; });
  for (int line = 0; line < count; ++line) found.begin[line + 2] += found.begin[line + 1];
  found.all.resize(found.begin[count + 1]);
  each([&](int line, const Corners& own) { found.all[found.begin[line + 1]++] = Cross(lines, line, own); });
  return found;
}

// One thread would take several times as long to test all triangles for each line.
inline void CoverLines(const TriangleMesh& mesh, const Lines& lines, int count, double* lengths) {
  const Crossings found = CrossingsOf(mesh, lines, count);
  for (int line = 0; line < count; ++line) {
    lengths[line] = Covered([&](auto f) {
      for (int i = found.begin[line]; i < found.begin[line + 1]; ++i) f(found.all[i]);
    });
  }
}

// Sorts stably: few by insertion, because neighbors often are in order.
inline void SortByLeft(Crossing* first, Crossing* end) {
  constexpr int kFew = 128;
  if (end - first > kFew) {
    std::stable_sort(first, end, [](const Crossing& a, const Crossing& b) { return a.left < b.left; });
    return;
  }
  for (Crossing* next = first; next < end; ++next) {
    const Crossing own = *next;
    Crossing* place = next;
    for (; place > first && own.left < place[-1].left; --place) *place = place[-1];
    *place = own;
  }
}

// Writes what each intersection adds to the covered length of its line, line after line and from left to right; returns
// their number. Their sum in the order of NumPy has bits of its own, which recorded scores of single simulations have.
inline long long CoveredParts(const TriangleMesh& mesh, const Lines& lines, int count, double* parts) {
  Crossings found = CrossingsOf(mesh, lines, count);
  double low = HUGE_VAL, high = -HUGE_VAL, reach = -HUGE_VAL;
  for (const Crossing& own : found.all) {
    if (own.left < low) low = own.left;
    if (own.right > high) high = own.right;
  }
  for (int line = 0; line < count; ++line) {
    Crossing* const first = found.all.data() + found.begin[line];
    Crossing* const end = found.all.data() + found.begin[line + 1];
    const double shift = line * (2.0 * (high - low) + 1.0);  // Lines are laid out side by side.
    for (Crossing* own = first; own < end; ++own) own->left += shift, own->right += shift;
    SortByLeft(first, end);
    for (const Crossing* own = first; own < end; ++own) {
      const double from = own->left > reach ? own->left : reach;
      *parts++ = own->right > from ? own->right - from : 0;
      if (own->right > reach) reach = own->right;
    }
  }
  return static_cast<long long>(found.all.size());
}

#endif

// Computes `area` [m^2]; `lengths`: memory for a number per line.
inline void CoverMesh(const TriangleMesh& mesh, long long count, double* lengths, double* area) {
  SGM_SHARED Key ends[2];
  Once([&] { ends[0] = ends[1] = ~Key{0}; });
  Each(static_cast<int>(3 * mesh.triangles), [&](int i) {
    const Key key = KeyOf(mesh.points[mesh.coordinates * mesh.corners[i] + 1]);
    TakeLeast(&ends[0], key);
    TakeLeast(&ends[1], ~key);
  });
  const double bottom = FromKey(ends[0]), pitch = (FromKey(~ends[1]) - bottom) / static_cast<double>(count);
  const bool is_flat = !(pitch > 0);  // Or not finite.
  if (!is_flat) CoverLines(mesh, {bottom, pitch}, static_cast<int>(count), lengths);
  Once([&] {
    double sum = 0;
    for (long long line = 0; !is_flat && line < count; ++line) sum += lengths[line];
    *area = sum * pitch;
  });
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_COVERED_H_
