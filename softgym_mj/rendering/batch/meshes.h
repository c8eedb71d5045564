// Triangles of sheets, ropes and rigid meshes in their current state.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_MESHES_H_
#define SOFTGYM_MJ_RENDERING_BATCH_MESHES_H_

#include "rendering/batch/scene.h"

namespace softgym_mj::pictures {
namespace {

// Computes vertices as means of points, with a small outward offset (entities/sheet.py).
inline void PlaceSheet(const Canvas& c) {
  const Scene& s = *c.scene;
  const int *starts = s.At<int>(s.weight_starts), *points = s.At<int>(s.weight_points);
  const int *around_starts = s.At<int>(s.around_starts), *around = s.At<int>(s.around);
  const int* triangles = s.At<int>(s.triangles);
  const float* weights = s.At<float>(s.weights);
  Each(s.num_vertices, [&](int i) {
    Point sum = {0, 0, 0};
    for (int k = starts[i]; k < starts[i + 1]; ++k) sum = sum + weights[k] * At(c.points + 3 * points[k]);
    c.places[i] = sum;
  });
  Each(s.num_vertices, [&](int i) {
    Point sum = {0, 0, 0};
    for (int k = around_starts[i]; k < around_starts[i + 1]; ++k) {
      const int* corners = triangles + 3 * around[k];
      const Point first = c.places[corners[0]];
      sum = sum + Cross(c.places[corners[1]] - first, c.places[corners[2]] - first);
    }
    c.normals[i] = Direction(sum);
  });
  Each(s.num_vertices, [&](int i) { c.places[i] = c.places[i] + s.inflate * c.normals[i]; });
}

inline void PlaceRope(const Canvas& c) {
  const Scene& s = *c.scene;
  const int caps = CapRings(s), count = TubeRings(s), row = s.sides + 1, body = count - 2 * caps;
  const double *circle = s.At<double>(s.circle), *quarter = s.At<double>(s.quarter);
  Once([&] { FollowCurve(c.points, s.num_points, s.rings_per_edge, c.rings + caps); });
  Each(2 * caps, [&](int i) {
    const int k = i / 2 + 1;
    const double cosine = quarter[2 * k], sine = quarter[2 * k + 1];
    if (i % 2) {
      c.rings[caps - k] = CapRing(c.rings[caps], -1, s.radius, k, caps, sine, cosine);
    } else {
      c.rings[caps + body - 1 + k] = CapRing(c.rings[caps + body - 1], 1, s.radius, k, caps, sine, cosine);
    }
  });
  Each(s.num_vertices, [&](int at) {
    const Ring& ring = c.rings[at / row];
    const int side = at % row % s.sides;
    c.out[at] = Outwards(ring, circle[2 * side], circle[2 * side + 1]);
    c.surface[at] = ring.center + static_cast<double>(s.radius) * ring.scale * c.out[at];
  });
  Each(s.num_vertices, [&](int at) {
    const int i = at / row;
    c.places[at] = At(c.surface[at]);
    c.normals[at] = At(TubeNormal(c.rings[i], c.surface, c.out[at], i, at % row, count, s.sides));
  });
}

inline void PlaceRigids(const Canvas& c) {
  const Scene& s = *c.scene;
  const float *places = s.At<float>(s.rigid_places), *normals = s.At<float>(s.rigid_normals);
  for (int r = 0; r < s.num_parts + s.num_glasses; ++r) {
    const Rigid& rigid = s.At<Rigid>(s.rigids)[r];
    Each(rigid.num_vertices, [&](int i) {
      const int at = rigid.first_vertex + i, to = s.num_vertices + at;
      const Pose pose = PoseOf(c, rigid.mover);
      c.places[to] = pose.position + Turned(pose.rotation, At(places + 3 * at));
      c.normals[to] = Turned(pose.rotation, At(normals + 3 * at));
    });
  }
}

// Computes frames of solids.
inline void PlaceSolids(const Canvas& c) {
  const Solid* solids = c.scene->At<Solid>(c.scene->solids);
  Each(c.scene->num_solids, [&](int i) {
    const Pose pose = PoseOf(c, solids[i].mover);
    const float* size = solids[i].size;
    const float around = sqrtf(size[0] * size[0] + size[1] * size[1] + size[2] * size[2]);
    c.frames[i].reach = solids[i].shape == kSphere ? size[0] : around;
    c.frames[i].is_turned = false;
    c.frames[i].position = pose.position + Turned(pose.rotation, At(solids[i].position));
    for (int k = 0; k < 9; ++k) {
      float sum = 0;
      for (int n = 0; n < 3; ++n) sum += pose.rotation[k / 3 * 3 + n] * solids[i].rotation[3 * n + k % 3];
      c.frames[i].rotation[k] = sum;
      if (sum != (k % 4 == 0 ? 1.0f : 0.0f)) c.frames[i].is_turned = true;
    }
  });
}

inline void PlaceMeshes(const Canvas& c) {
  PlaceSolids(c);
  if (c.scene->kind == kSheet) PlaceSheet(c);
  if (c.scene->kind == kRope) PlaceRope(c);
  PlaceRigids(c);
}

// Projects vertices to the image.
inline void Project(const Canvas& c, const Eye& eye) {
  constexpr float kNearest = 0.01f, kFarthest = 1e7f;  // [m], [1/256 of a sample]
  const float up = 0.5f * static_cast<float>(c.height) / eye.slope;
  Each(NumVertices(*c.scene), [&](int i) {
    const Point p = TurnedBack(eye.rotation, c.places[i] - At(eye.position));
    const float distance = -p.z;
    c.nearness[i] = distance > kNearest ? 1 / distance : 0;  // 0: neither the vertex nor its triangles are visible.
    const float x = 0.5f * static_cast<float>(c.width) + up * p.x * c.nearness[i];
    const float y = 0.5f * static_cast<float>(c.height) - up * p.y * c.nearness[i];
    const auto within = [](float a) { return a < -kFarthest ? -kFarthest : a > kFarthest ? kFarthest : a; };
    c.image[2 * i] = static_cast<int>(floorf(within(256 * x) + 0.5f));
    c.image[2 * i + 1] = static_cast<int>(floorf(within(256 * y) + 0.5f));
  });
}

// Calls f(x, y, value) for each sample of a (width, height) grid in a front-facing triangle; a shared side belongs to
// exactly one triangle (integer arithmetic). `corners`: x, y of each [1/256 of a sample], x to the right, y downwards.
// `values`: at corners, interpolated linearly. It handles row `share` and every `shares`-th row after it.
template <class F>
inline void EachSample(const int corners[3][2], const float values[3], int width, int height, int share, int shares,
                       const F& f) {
  // Counterclockwise in the world frame is clockwise if y points downwards.
  const int order[3] = {0, 2, 1};
  long long x[3], y[3];
  float value[3];
  for (int k = 0; k < 3; ++k) x[k] = corners[order[k]][0], y[k] = corners[order[k]][1], value[k] = values[order[k]];
  const long long area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
  if (area <= 0) return;
  const auto first = [](long long low) { return static_cast<int>((low - 128 + 255) >> 8); };  // At 128 + 256 i.
  const auto last = [](long long high) { return static_cast<int>((high - 128) >> 8); };
  const long long low_x = std::min(x[0], std::min(x[1], x[2])), high_x = std::max(x[0], std::max(x[1], x[2]));
  const long long low_y = std::min(y[0], std::min(y[1], y[2])), high_y = std::max(y[0], std::max(y[1], y[2]));
  const int x0 = std::max(first(low_x), 0), x1 = std::min(last(high_x), width - 1);
  const int y0 = std::max(first(low_y), 0) + share, y1 = std::min(last(high_y), height - 1);
  long long slope_x[3], slope_y[3], start[3];
  for (int k = 0; k < 3; ++k) {  // The side opposite to corner k.
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    const long long dx = x[b] - x[a], dy = y[b] - y[a];
    slope_x[k] = -256 * dy, slope_y[k] = 256 * dx;
    start[k] = dx * (256LL * y0 + 128 - y[a]) - dy * (256LL * x0 + 128 - x[a]);
    const bool owns = dy < 0 || (dy == 0 && dx > 0);
    if (!owns) start[k] -= 1;
  }
  const float whole = static_cast<float>(area);
  for (int j = y0; j <= y1; j += shares) {
    long long e[3] = {start[0], start[1], start[2]};
    for (int i = x0; i <= x1; ++i) {
      if ((e[0] | e[1] | e[2]) >= 0) {
        const float sum = static_cast<float>(e[0]) * value[0] + static_cast<float>(e[1]) * value[1] +
                          static_cast<float>(e[2]) * value[2];
        f(i, j, sum / whole);
      }
      for (int k = 0; k < 3; ++k) e[k] += slope_x[k];
    }
    for (int k = 0; k < 3; ++k) start[k] += shares * slope_y[k];
  }
}

inline void Clear(const Canvas& c, Key* nearest) {
  Each(c.width * c.height, [&](int i) { nearest[i] = kNone; });
}

// Puts the nearest triangle into each sample, behind `before` if that is not null. Large triangles are rendered in
// `shares` parts.
inline void DrawTriangles(const Canvas& c, int first, int end, int shares, const Key* before, Key* nearest) {
  const Scene& s = *c.scene;
  const int* triangles = s.At<int>(s.triangles);
  Each((end - first) * shares, [&](int k) {
    const int t = first + k / shares, *corner = triangles + 3 * t;
    int corners[3][2];
    float values[3];
    for (int n = 0; n < 3; ++n) {
      corners[n][0] = c.image[2 * corner[n]], corners[n][1] = c.image[2 * corner[n] + 1];
      values[n] = c.nearness[corner[n]];
      if (values[n] <= 0) return;
    }
    EachSample(corners, values, c.width, c.height, k % shares, shares, [&](int x, int y, float nearness) {
      const Key key = static_cast<Key>(Reread<unsigned>(1 / nearness)) << 32 | static_cast<unsigned>(t);
      const int at = y * c.width + x;
      if (before && key <= before[at]) return;
      TakeLeast(&nearest[at], key);
    });
  });
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_MESHES_H_
