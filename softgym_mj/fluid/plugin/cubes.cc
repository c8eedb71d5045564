#include "cubes.h"

#include <algorithm>

namespace softgym_mj {
namespace {

constexpr int kEdges = 12, kFaces = 6, kNone = -1;

int Edge(int p, int q) {
  const int axis = (p ^ q) >> 1, low = std::min(p, q);  // 1, 2, 4 to 0, 1, 2.
  return 4 * axis + ((low >> (axis + 1) % 3) & 1) + 2 * ((low >> (axis + 2) % 3) & 1);
}

// Corners of a face, counterclockwise seen from outside.
std::array<int, 4> Face(int face) {
  const int axis = face / 2, b = 1 << (axis + 1) % 3, c = 1 << (axis + 2) % 3, side = (face & 1) << axis;
  std::array<int, 4> corners = {side, side | b, side | b | c, side | c};
  if (!side) std::swap(corners[1], corners[3]);
  return corners;
}

bool ShareFace(int e, int f) {
  for (int face = 0; face < kFaces; ++face) {
    const std::array<int, 4> corners = Face(face);
    bool has_e = false, has_f = false;
    for (int i = 0; i < 4; ++i) {
      const int edge = Edge(corners[i], corners[(i + 1) % 4]);
      has_e |= edge == e;
      has_f |= edge == f;
    }
    if (has_e && has_f) return true;
  }
  return false;
}

// Adds a fan of triangles. None of its diagonals may lie in a face: the next cube could have the same one.
void AddFan(const std::vector<int>& loop, std::vector<int>* triangles) {
  const int n = static_cast<int>(loop.size());
  for (int first = 0; first < n; ++first) {
    bool inner = true;
    for (int k = 2; k < n - 1; ++k) inner &= !ShareFace(loop[first], loop[(first + k) % n]);
    if (!inner) continue;  // Some corner is good, in all cases.
    for (int k = 1; k < n - 1; ++k) {
      for (int i : {first, first + k, first + k + 1}) triangles->push_back(loop[i % n]);
    }
    return;
  }
}

std::vector<int> Triangulate(int inside) {
  // On a face the surface connects the ends of each run of inner corners.
  std::array<int, kEdges> next;
  next.fill(kNone);
  for (int face = 0; face < kFaces; ++face) {
    const std::array<int, 4> corners = Face(face);
    const auto is_in = [&](int i) { return (inside >> corners[i & 3]) & 1; };
    for (int i = 0; i < 4; ++i) {
      if (!is_in(i) || is_in(i + 1)) continue;
      int first = i + 4;
      while (is_in(first - 1)) --first;
      next[Edge(corners[(first - 1) & 3], corners[first & 3])] = Edge(corners[i], corners[(i + 1) & 3]);
    }
  }
  std::vector<int> triangles;
  for (int edge = 0; edge < kEdges; ++edge) {
    std::vector<int> loop;
    for (int e = edge; next[e] != kNone;) {
      loop.push_back(e);
      const int following = next[e];
      next[e] = kNone;
      e = following;
    }
    if (!loop.empty()) AddFan(loop, &triangles);
  }
  return triangles;
}

}  // namespace

CubeEdge EdgeOfCube(int edge) {
  const int axis = edge / 4, b = (axis + 1) % 3, c = (axis + 2) % 3;
  return {axis, (edge & 1) << b | ((edge >> 1) & 1) << c};
}

const std::array<std::vector<int>, 256>& CubeTriangles() {
  static const std::array<std::vector<int>, 256> triangles = [] {
    std::array<std::vector<int>, 256> all;
    for (int inside = 0; inside < 256; ++inside) all[inside] = Triangulate(inside);
    return all;
  }();
  return triangles;
}

}  // namespace softgym_mj
