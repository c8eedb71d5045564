#include "proximity.h"

#include <algorithm>
#include <cmath>

namespace softgym_mj {
namespace {

// Pairs are of interest up to this many thicknesses beyond what they may move: others push them nearer.
constexpr float kInterest = 1.3f;
// The boxes of vertices are larger than their motion in a step by so many such motions and by so many
// thicknesses: the candidates then last for several steps, at rest for many.
constexpr float kSpareSteps = 3.0f, kSpare = 0.1f, kMostSpare = 0.5f;
// Where two surfaces lie flat on each other, to this cosine, their vertices keep them apart well enough:
// edges count only if they overlap by this share of the thickness.
constexpr double kFlat = 0.97, kFlatOverlap = 0.1;
constexpr double kTouching = 1e-9;  // [m] Nearer than this there is no normal.

void Grow(float* box, const float* other) {
  for (int k = 0; k < 3; ++k) {
    box[k] = std::min(box[k], other[k]);
    box[k + 3] = std::max(box[k + 3], other[k + 3]);
  }
}

}  // namespace

void Proximity::Boxes::Sort(const std::vector<float>& boxes, int size, int along) {
  count = size;
  axis = along;
  id.resize(count + 8);
  std::vector<std::pair<float, int>> order(count);
  for (int i = 0; i < count; ++i) order[i] = {boxes[6 * i + axis], i};
  std::sort(order.begin(), order.end());
  widest = 0;
  for (int k = 0; k < 3; ++k) {
    low[k].resize(count + 8);
    high[k].resize(count + 8);
  }
  for (int i = 0; i < count; ++i) {
    id[i] = order[i].second;
    for (int k = 0; k < 3; ++k) {
      low[k][i] = boxes[6 * id[i] + (axis + k) % 3];
      high[k][i] = boxes[6 * id[i] + 3 + (axis + k) % 3];
    }
    widest = std::max(widest, high[0][i] - low[0][i]);
  }
}

BoxView Proximity::Boxes::View() const {
  return {{low[0].data(), low[1].data(), low[2].data()},
          {high[0].data(), high[1].data(), high[2].data()},
          id.data()};
}

void Proximity::Reset(const Mesh& mesh) {
  built_ = false;
  const float thickness = *std::max_element(mesh.thickness.begin(), mesh.thickness.end());
  reach_ = kInterest * thickness / 2;
}

bool Proximity::Covers(const Motion& motion) const {
  const int count = static_cast<int>(motion.start.size());
  for (int v = 0; v < count; ++v) {
    const double start[3] = {motion.start[v].x, motion.start[v].y, motion.start[v].z};
    for (int k = 0; k < 3; ++k) {
      const double end = start[k] + motion.move[4 * v + k];
      if (std::min(start[k], end) - reach_ < box_[6 * v + k]) return false;
      if (std::max(start[k], end) + reach_ > box_[6 * v + 3 + k]) return false;
    }
  }
  return true;
}

bool Proximity::Vouches(const Mesh& mesh, const Motion& motion,
                        const std::vector<float>& before) const {
  // Find leaves out pairs that would stay apart by more than the reach: both sides must have changed
  // course by half of that before they can meet.
  const float least = *std::min_element(mesh.thickness.begin(), mesh.thickness.end());
  const float most = kInterest * least / 2;
  float change = 0;
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
      const float difference = motion.move[4 * v + k] - before[4 * v + k];
      square += difference * difference;
    }
    change = std::max(change, square);
  }
  return change < most * most && Covers(motion);
}

void Proximity::Overlapping(const Boxes& boxes, int first, int last, const float* box) {
  const int a = boxes.axis, b = (a + 1) % 3, c = (a + 2) % 3;
  const float turned[6] = {box[a], box[b], box[c], box[a + 3], box[b + 3], box[c + 3]};
  found_.resize(boxes.count + 8);
  found_.resize(kernels_->Scan(boxes.View(), first, last, turned, found_.data()));
}

void Proximity::Build(const Mesh& mesh, const Motion& motion) {
  kernels_ = &ChooseContactKernels();
  const int vertices = mesh.NumVertices();
  box_.resize(6 * vertices);
  float low[3] = {1e30f, 1e30f, 1e30f}, high[3] = {-1e30f, -1e30f, -1e30f};
  for (int v = 0; v < vertices; ++v) {
    const double start[3] = {motion.start[v].x, motion.start[v].y, motion.start[v].z};
    const float move = static_cast<float>(Norm(motion.Move(v)));
    const float spare = std::min(kSpareSteps * move + kSpare * reach_, kMostSpare * reach_);
    const float pad = 1.0001f * reach_ + spare;  // A hair more than the reach, for what rounding takes.
    for (int k = 0; k < 3; ++k) {
      const float a = static_cast<float>(start[k]);
      const float b = static_cast<float>(start[k] + motion.move[4 * v + k]);
      box_[6 * v + k] = std::min(a, b) - pad;
      box_[6 * v + 3 + k] = std::max(a, b) + pad;
      low[k] = std::min(low[k], a);
      high[k] = std::max(high[k], a);
    }
  }
  int axis = 0;
  for (int k = 1; k < 3; ++k) {
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  }
  const int num_triangles = static_cast<int>(mesh.triangles.size());
  const int num_edges = static_cast<int>(mesh.edges.size());
  scratch_.resize(6 * std::max(num_triangles, num_edges));
  for (int t = 0; t < num_triangles; ++t) {
    const int* v = mesh.triangles[t].vertex;
    std::copy_n(&box_[6 * v[0]], 6, &scratch_[6 * t]);
    Grow(&scratch_[6 * t], &box_[6 * v[1]]);
    Grow(&scratch_[6 * t], &box_[6 * v[2]]);
  }
  triangles_.Sort(scratch_, num_triangles, axis);
  near_triangle_.clear();
  near_triangle_begin_.assign(1, 0);
  for (int v = 0; v < vertices; ++v) {
    const float* box = &box_[6 * v];
    const auto begin = triangles_.low[0].begin(), end = begin + num_triangles;
    const auto first = std::lower_bound(begin, end, box[axis] - triangles_.widest);
    const auto last = std::upper_bound(first, end, box[axis + 3]);
    Overlapping(triangles_, static_cast<int>(first - begin), static_cast<int>(last - begin), box);
    const size_t old = near_triangle_.size();
    for (int t : found_) {
      const int* w = mesh.triangles[t].vertex;
      if (v != w[0] && v != w[1] && v != w[2]) near_triangle_.push_back(t);
    }
    std::sort(near_triangle_.begin() + old, near_triangle_.end());
    near_triangle_begin_.push_back(static_cast<int>(near_triangle_.size()));
  }
  near_triangle_.insert(near_triangle_.end(), 8, 0);
  for (int e = 0; e < num_edges; ++e) {
    const int* v = mesh.edges[e].vertex;
    std::copy_n(&box_[6 * v[0]], 6, &scratch_[6 * e]);
    Grow(&scratch_[6 * e], &box_[6 * v[1]]);
  }
  edges_.Sort(scratch_, num_edges, axis);
  pairs_.clear();
  near_edge_begin_.assign(num_edges + 1, 0);
  for (int i = 0; i < num_edges; ++i) {
    const int e = edges_.id[i];
    const float* box = &scratch_[6 * e];
    const auto begin = edges_.low[0].begin(), end = begin + num_edges;
    const auto last = std::upper_bound(begin + i, end, box[axis + 3]);
    Overlapping(edges_, i + 1, static_cast<int>(last - begin), box);
    const int* v = mesh.edges[e].vertex;
    for (int f : found_) {
      const int* w = mesh.edges[f].vertex;
      if (v[0] == w[0] || v[0] == w[1] || v[1] == w[0] || v[1] == w[1]) continue;
      pairs_.push_back(std::min(e, f));
      pairs_.push_back(std::max(e, f));
      ++near_edge_begin_[std::min(e, f) + 1];
    }
  }
  for (int e = 0; e < num_edges; ++e) near_edge_begin_[e + 1] += near_edge_begin_[e];
  near_edge_.assign(pairs_.size() / 2 + 8, 0);
  end_ = near_edge_begin_;
  for (size_t i = 0; i < pairs_.size(); i += 2) near_edge_[end_[pairs_[i]]++] = pairs_[i + 1];
  for (int e = 0; e < num_edges; ++e) {
    std::sort(near_edge_.begin() + near_edge_begin_[e], near_edge_.begin() + near_edge_begin_[e + 1]);
  }
  built_ = true;
}

void Proximity::Describe(const Mesh& mesh, const Motion& motion) {
  const auto put = [](std::vector<float>* arrays, size_t i, Vector a) {
    arrays[0][i] = static_cast<float>(a.x);
    arrays[1][i] = static_cast<float>(a.y);
    arrays[2][i] = static_cast<float>(a.z);
  };
  for (std::vector<float>& array : edge_) array.resize(mesh.edges.size());
  for (size_t e = 0; e < mesh.edges.size(); ++e) {
    const int a = mesh.edges[e].vertex[0], b = mesh.edges[e].vertex[1];
    const Vector u = motion.Move(a), v = motion.Move(b);
    put(edge_, e, motion.start[a]);
    put(edge_ + 3, e, motion.start[b] - motion.start[a]);
    put(edge_ + 6, e, 0.5 * (u + v));
    edge_[9][e] = static_cast<float>(0.5 * Norm(u - v));
  }
  for (std::vector<float>& array : triangle_) array.resize(mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const int* v = mesh.triangles[t].vertex;
    const Vector a = motion.start[v[0]], b = motion.start[v[1]], c = motion.start[v[2]];
    const Vector centre = (1.0 / 3) * (a + b + c), normal = Cross(b - a, c - a);
    const double length = Norm(normal), scale = length > 0 ? 1 / length : 0;
    const Vector ua = motion.Move(v[0]), ub = motion.Move(v[1]), uc = motion.Move(v[2]);
    const Vector move = (1.0 / 3) * (ua + ub + uc);
    put(triangle_, t, centre);
    put(triangle_ + 3, t, scale * normal);
    put(triangle_ + 6, t, move);
    const double spread =
        std::max({Dot(ua - move, ua - move), Dot(ub - move, ub - move), Dot(uc - move, uc - move)});
    const double radius = std::max(
        {Dot(a - centre, a - centre), Dot(b - centre, b - centre), Dot(c - centre, c - centre)});
    triangle_[9][t] = static_cast<float>(std::sqrt(spread));
    triangle_[10][t] = static_cast<float>(std::sqrt(radius));
  }
}

// Whether the triangles at an edge lie nearly across `normal`.
bool Proximity::IsFlat(const Mesh::Edge& edge, Vector normal) const {
  for (int t : edge.triangle) {
    if (t < 0) continue;
    const Vector n = {triangle_[3][t], triangle_[4][t], triangle_[5][t]};
    if (std::fabs(Dot(n, normal)) < kFlat) return false;
  }
  return true;
}

void Proximity::Find(const Mesh& mesh, const Motion& motion, std::vector<Pair>* pairs) {
  if (!built_ || !Covers(motion)) Build(mesh, motion);
  Describe(mesh, motion);
  pairs->clear();
  const float reach = 2 * reach_;
  const EdgeView edge_view = {{edge_[0].data(), edge_[1].data(), edge_[2].data()},
                              {edge_[3].data(), edge_[4].data(), edge_[5].data()},
                              {edge_[6].data(), edge_[7].data(), edge_[8].data()},
                              edge_[9].data()};
  const TriangleView triangle_view = {
      {triangle_[0].data(), triangle_[1].data(), triangle_[2].data()},
      {triangle_[3].data(), triangle_[4].data(), triangle_[5].data()},
      {triangle_[6].data(), triangle_[7].data(), triangle_[8].data()},
      triangle_[9].data(),
      triangle_[10].data()};
  found_.resize(8 + std::max(near_triangle_.size(), near_edge_.size()));
  const std::vector<Vector>& x = motion.start;
  const auto add = [pairs](const Pair& pair, Vector apart, double square) {
    pairs->push_back(pair);
    Pair& added = pairs->back();
    added.distance = std::sqrt(square);
    added.normal = (1 / added.distance) * apart;
  };
  // Square of the distance up to which a pair is of interest.
  const auto limit = [&](int v, int w, double square_a, double square_b) {
    const double approach = std::sqrt(std::max(square_a, square_b));
    const double reach = kInterest * mesh.thickness[mesh.Pair(v, w)] + approach;
    return reach * reach;
  };
  const auto relative = [&](int v, int w) {
    const Vector r = motion.Move(v) - motion.Move(w);
    return Dot(r, r);
  };
  const int vertices = mesh.NumVertices();
  for (int v = 0; v < vertices; ++v) {
    const float point[3] = {static_cast<float>(x[v].x), static_cast<float>(x[v].y),
                            static_cast<float>(x[v].z)};
    const int first = near_triangle_begin_[v], candidates = near_triangle_begin_[v + 1] - first;
    const int found = kernels_->NearTriangles(triangle_view, point, &motion.move[4 * v],
                                              &near_triangle_[first], candidates, reach,
                                              found_.data());
    for (int i = 0; i < found; ++i) {
      const Mesh::Triangle& triangle = mesh.triangles[found_[i]];
      const int a = triangle.vertex[0], b = triangle.vertex[1], c = triangle.vertex[2];
      double w[3];
      const int feature = ClosestOnTriangle(x[v], x[a], x[b], x[c], w);
      const Vector apart = x[v] - w[0] * x[a] - w[1] * x[b] - w[2] * x[c];
      const double square = Dot(apart, apart);
      const double most = limit(v, a, relative(v, a), std::max(relative(v, b), relative(v, c)));
      if (square >= most || square < kTouching * kTouching) continue;
      // Of two vertices, only the first counts.
      const bool counts = (triangle.owned >> feature & 1) &&
                          ((feature & (feature - 1)) || v < triangle.vertex[feature >> 1]);
      add({{v, a, b, c}, {1, -w[0], -w[1], -w[2]}, {}, 0, false, counts}, apart, square);
    }
  }
  const int edges = static_cast<int>(mesh.edges.size());
  for (int e = 0; e < edges; ++e) {
    const int a = mesh.edges[e].vertex[0], b = mesh.edges[e].vertex[1];
    const int first = near_edge_begin_[e], candidates = near_edge_begin_[e + 1] - first;
    const int found = kernels_->NearEdges(edge_view, e, &near_edge_[first], candidates, reach,
                                          found_.data());
    for (int i = 0; i < found; ++i) {
      const Mesh::Edge& other = mesh.edges[found_[i]];
      const int c = other.vertex[0], d = other.vertex[1];
      double s, t;
      const bool inside = ClosestOnSegments(x[a], x[b], x[c], x[d], &s, &t);
      const Vector apart = (1 - s) * x[a] + s * x[b] - (1 - t) * x[c] - t * x[d];
      const double square = Dot(apart, apart);
      const double most = limit(a, c, std::max(relative(a, c), relative(a, d)),
                                std::max(relative(b, c), relative(b, d)));
      if (square >= most || square < kTouching * kTouching) continue;
      // The end of an edge that meets a surface counts as a vertex against a triangle.
      const bool surfaces = mesh.edges[e].OnSurface() && other.OnSurface();
      const bool counts = inside || !surfaces;
      add({{a, b, c, d}, {1 - s, s, t - 1, -t}, {}, 0, true, counts}, apart, square);
      if (inside && surfaces) {
        Pair& pair = pairs->back();
        const float thickness = mesh.thickness[mesh.Pair(a, c)];
        pair.counts = pair.distance < (1 - kFlatOverlap) * thickness ||
                      !(IsFlat(mesh.edges[e], pair.normal) && IsFlat(other, pair.normal));
      }
    }
  }
}

}  // namespace softgym_mj
