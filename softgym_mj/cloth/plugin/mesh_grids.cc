#include "cloth/plugin/mesh_grids.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "native/closest.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kMargin = 0.015;                   // [m] Of the grid around the mesh.
constexpr double kFinest = 1e-3, kCoarsest = 0.01;  // [m] Distances of nodes.
constexpr double kCoarser = 1.01;                   // Factor of the distance until there are few enough nodes.
constexpr int kMostNodes = 1 << 19;                 // 8 MB.
constexpr double kBand = 1.8;                       // [nodes' distances] Nodes as near as this to a triangle are exact.
constexpr size_t kMostKept = 16;                    // Grids kept for later models of the process.

using Triangle = std::array<int, 3>;

struct Surface {
  std::vector<Vector> vertices;
  std::vector<Triangle> triangles;
};

double& Part(Vector* v, int axis) { return axis == 0 ? v->x : axis == 1 ? v->y : v->z; }
double Part(const Vector& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// Copies a mesh. Equal vertices become one; triangles without three different vertices are left out.
Surface CopySurface(const mjModel* m, int mesh) {
  Surface out;
  std::map<std::array<float, 3>, int> number;
  std::vector<int> of_vertex(m->mesh_vertnum[mesh]);
  for (int v = 0; v < m->mesh_vertnum[mesh]; ++v) {
    const float* x = m->mesh_vert + 3 * (m->mesh_vertadr[mesh] + v);
    const auto found = number.try_emplace({x[0], x[1], x[2]}, static_cast<int>(out.vertices.size()));
    if (found.second) out.vertices.push_back({x[0], x[1], x[2]});
    of_vertex[v] = found.first->second;
  }
  for (int f = 0; f < m->mesh_facenum[mesh]; ++f) {
    const int* v = m->mesh_face + 3 * (m->mesh_faceadr[mesh] + f);
    const Triangle t = {of_vertex[v[0]], of_vertex[v[1]], of_vertex[v[2]]};
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) out.triangles.push_back(t);
  }
  return out;
}

// Whether each edge is passed as often in one direction as in the other.
bool IsClosed(const std::vector<Triangle>& triangles) {
  std::map<std::pair<int, int>, int> passed;
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      passed[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  return std::all_of(passed.begin(), passed.end(), [](const auto& edge) { return edge.second == 0; });
}

// Computes signed distances at the nodes of a grid.
class Distances {
 public:
  Distances(const Surface& surface, const Vector& low, double step, const int count[3])
      : surface_(surface), low_(low), step_(step), count_{count[0], count[1], count[2]} {
    const size_t size = static_cast<size_t>(count[0]) * count[1] * count[2];
    square_.assign(size, std::numeric_limits<double>::max());
    nearest_.assign(size, -1);
    for (size_t t = 0; t < surface.triangles.size(); ++t) FillBand(static_cast<int>(t));
    for (int direction = 0; direction < 8; ++direction) Spread(direction);
    distance_.resize(size);
    for (size_t i = 0; i < size; ++i) distance_[i] = std::sqrt(square_[i]);
    SetSigns();
  }

  double At(int x, int y, int z) const { return distance_[Index(x, y, z)]; }

 private:
  size_t Index(int x, int y, int z) const { return (static_cast<size_t>(z) * count_[1] + y) * count_[0] + x; }
  Vector NodeAt(int x, int y, int z) const { return {low_.x + step_ * x, low_.y + step_ * y, low_.z + step_ * z}; }

  void Try(size_t i, const Vector& node, int triangle) {
    const Triangle& t = surface_.triangles[triangle];
    const Vector &a = surface_.vertices[t[0]], &b = surface_.vertices[t[1]], &c = surface_.vertices[t[2]];
    double w[3];
    ClosestOnTriangle(node, a, b, c, w);
    const Vector off = node - (w[0] * a + w[1] * b + w[2] * c);
    const double square = Dot(off, off);
    if (square < square_[i]) square_[i] = square, nearest_[i] = triangle;
  }

  // First and last node of an axis between two coordinates [m].
  void Between(int axis, double from, double to, int* first, int* last) const {
    const double origin = Part(low_, axis), most = count_[axis] - 1;
    *first = static_cast<int>(std::ceil(std::min(std::max((from - origin) / step_, 0.0), most)));
    *last = static_cast<int>(std::floor(std::min(std::max((to - origin) / step_, 0.0), most)));
  }

  // Computes the distance of a triangle to the nodes in the box around it that are near its plane.
  void FillBand(int triangle) {
    const Triangle& t = surface_.triangles[triangle];
    const double band = kBand * step_;
    int first[3], last[3];
    for (int k = 0; k < 3; ++k) {
      const auto ends = std::minmax(
          {Part(surface_.vertices[t[0]], k), Part(surface_.vertices[t[1]], k), Part(surface_.vertices[t[2]], k)});
      Between(k, ends.first - band, ends.second + band, &first[k], &last[k]);
    }
    const Vector& a = surface_.vertices[t[0]];
    const Vector cross = Cross(surface_.vertices[t[1]] - a, surface_.vertices[t[2]] - a);
    const double reach = band * Norm(cross);
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        int from = first[0], to = last[0];
        const double rest = Dot(cross, NodeAt(0, y, z) - a) - cross.x * low_.x;  // Plane: |rest + cross.x x| < reach.
        if (std::abs(cross.x) > 1e-9 * Norm(cross)) {
          const double middle = -rest / cross.x, half = reach / std::abs(cross.x);
          Between(0, middle - half, middle + half, &from, &to);
          from = std::max(from, first[0]), to = std::min(to, last[0]);
        }
        for (int x = from; x <= to; ++x) Try(Index(x, y, z), NodeAt(x, y, z), triangle);
      }
    }
  }

  // Tries the nearest triangles of adjacent nodes at all nodes, in one of eight orders (fast sweeping, Zhao, 2005).
  void Spread(int direction) {
    const int back[3] = {direction & 1 ? 1 : -1, direction & 2 ? 1 : -1, direction & 4 ? 1 : -1};
    const auto in_order = [&](int axis, int i) { return back[axis] < 0 ? i : count_[axis] - 1 - i; };
    for (int k = 0; k < count_[2]; ++k) {
      for (int j = 0; j < count_[1]; ++j) {
        for (int i = 0; i < count_[0]; ++i) {
          const int place[3] = {in_order(0, i), in_order(1, j), in_order(2, k)};
          const size_t here = Index(place[0], place[1], place[2]);
          for (int axis = 0; axis < 3; ++axis) {
            int next[3] = {place[0], place[1], place[2]};
            next[axis] += back[axis];
            if (next[axis] < 0 || next[axis] >= count_[axis]) continue;
            const int triangle = nearest_[Index(next[0], next[1], next[2])];
            if (triangle >= 0 && triangle != nearest_[here]) Try(here, NodeAt(place[0], place[1], place[2]), triangle);
          }
        }
      }
    }
  }

  // Winding number of a triangle around a point in the y-z plane, and where the line through the point along x crosses
  // it. Opposite edges contribute opposite numbers in any rounding: the sum over a closed mesh is 0.
  int Crosses(const Triangle& t, double y, double z, double* x) const {
    const Vector corner[3] = {surface_.vertices[t[0]], surface_.vertices[t[1]], surface_.vertices[t[2]]};
    int winding = 0;
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      const Vector &p = surface_.vertices[std::min(a, b)], &q = surface_.vertices[std::max(a, b)];
      if ((p.z > z) == (q.z > z) || p.y + (z - p.z) / (q.z - p.z) * (q.y - p.y) <= y) continue;
      winding += surface_.vertices[b].z > z ? 1 : -1;
    }
    if (winding == 0) return 0;
    const Vector normal = Cross(corner[1] - corner[0], corner[2] - corner[0]);
    const auto ends = std::minmax({corner[0].x, corner[1].x, corner[2].x});
    const double way = (normal.y * (y - corner[0].y) + normal.z * (z - corner[0].z)) / normal.x;
    *x = normal.x != 0 ? std::min(std::max(corner[0].x - way, ends.first), ends.second) : ends.first;
    return winding;
  }

  // A node is inside if the winding number along the line of nodes through it is not 0 there.
  void SetSigns() {
    std::vector<std::vector<std::pair<double, int>>> crossings(static_cast<size_t>(count_[1]) * count_[2]);
    for (const Triangle& t : surface_.triangles) {
      int first[3], last[3];
      for (int k = 1; k < 3; ++k) {
        const auto ends = std::minmax(
            {Part(surface_.vertices[t[0]], k), Part(surface_.vertices[t[1]], k), Part(surface_.vertices[t[2]], k)});
        Between(k, ends.first, ends.second, &first[k], &last[k]);
      }
      for (int k = first[2]; k <= last[2]; ++k) {
        for (int j = first[1]; j <= last[1]; ++j) {
          const Vector node = NodeAt(0, j, k);
          double x;
          const int winding = Crosses(t, node.y, node.z, &x);
          if (winding != 0) crossings[static_cast<size_t>(k) * count_[1] + j].push_back({x, winding});
        }
      }
    }
    for (int k = 0; k < count_[2]; ++k) {
      for (int j = 0; j < count_[1]; ++j) {
        auto& line = crossings[static_cast<size_t>(k) * count_[1] + j];
        std::sort(line.begin(), line.end());
        size_t next = 0;
        int winding = 0;
        for (int i = 0; i < count_[0]; ++i) {
          for (; next < line.size() && line[next].first < low_.x + step_ * i; ++next) winding += line[next].second;
          if (winding != 0) distance_[Index(i, j, k)] *= -1;
        }
      }
    }
  }

  const Surface& surface_;
  const Vector low_;
  const double step_;
  const int count_[3];
  std::vector<double> square_, distance_;
  std::vector<int> nearest_;
};

std::string Fill(const Surface& surface, MeshGrid* out) {
  if (surface.triangles.empty() || !IsClosed(surface.triangles)) {
    return "a closed mesh: each edge belongs to two triangles of the same orientation";
  }
  Vector low = surface.vertices[0], high = low;
  for (const Triangle& t : surface.triangles) {
    for (int v : t) {
      for (int k = 0; k < 3; ++k) {
        Part(&low, k) = std::min(Part(low, k), Part(surface.vertices[v], k) - kMargin);
        Part(&high, k) = std::max(Part(high, k), Part(surface.vertices[v], k) + kMargin);
      }
    }
  }
  double step = kFinest, nodes = 1;
  Grid* grid = &out->grid;
  for (; step <= kCoarsest; step *= kCoarser) {
    nodes = 1;
    for (int k = 0; k < 3; ++k) nodes *= std::ceil((Part(high, k) - Part(low, k)) / step) + 1;
    if (nodes <= kMostNodes) break;
  }
  if (!(nodes <= kMostNodes)) {
    return "a mesh whose box has at most 0.5 m^3, so that the nodes of its grid are 1 cm apart: divide it";
  }
  for (int k = 0; k < 3; ++k) {
    grid->count[k] = static_cast<int>(std::ceil((Part(high, k) - Part(low, k)) / step)) + 1;
    grid->low[k] = static_cast<float>(Part(low, k));
    grid->step[k] = static_cast<float>(step);
  }
  const Distances distances(surface, {grid->low[0], grid->low[1], grid->low[2]}, grid->step[0], grid->count);
  out->nodes.reserve(4 * static_cast<size_t>(nodes));
  const auto slope = [](double from, double to, int first, int last, float spacing) {
    return static_cast<float>((to - from) / ((last - first) * spacing));
  };
  for (int z = 0; z < grid->count[2]; ++z) {
    for (int y = 0; y < grid->count[1]; ++y) {
      for (int x = 0; x < grid->count[0]; ++x) {
        int place[3] = {x, y, z};
        for (int k = 0; k < 3; ++k) {
          int first[3] = {x, y, z}, last[3] = {x, y, z};
          first[k] = std::max(place[k] - 1, 0);
          last[k] = std::min(place[k] + 1, grid->count[k] - 1);
          out->nodes.push_back(slope(distances.At(first[0], first[1], first[2]),
                                     distances.At(last[0], last[1], last[2]), first[k], last[k], grid->step[k]));
        }
        out->nodes.push_back(static_cast<float>(distances.At(x, y, z)));
      }
    }
  }
  grid->nodes = out->nodes.data();
  return "";
}

}  // namespace

std::string FindMeshGrid(const mjModel* m, int mesh, std::shared_ptr<const MeshGrid>* grid) {
  static std::mutex* mutex = new std::mutex;  // Never destroyed, because models may outlive static objects.
  static auto* kept = new std::vector<std::pair<std::string, std::shared_ptr<const MeshGrid>>>;
  std::string key(reinterpret_cast<const char*>(m->mesh_vert + 3 * m->mesh_vertadr[mesh]),
                  3 * sizeof(float) * m->mesh_vertnum[mesh]);
  key.append(reinterpret_cast<const char*>(m->mesh_face + 3 * m->mesh_faceadr[mesh]),
             3 * sizeof(int) * m->mesh_facenum[mesh]);
  const std::lock_guard<std::mutex> lock(*mutex);
  auto found = std::find_if(kept->begin(), kept->end(), [&](const auto& each) { return each.first == key; });
  if (found == kept->end()) {
    auto made = std::make_shared<MeshGrid>();
    const std::string wrong = Fill(CopySurface(m, mesh), made.get());
    if (!wrong.empty()) return wrong;
    if (kept->size() == kMostKept) kept->erase(kept->begin());
    kept->emplace_back(key, made);
    found = kept->end() - 1;
  }
  std::rotate(found, found + 1, kept->end());  // The last ones used are at the end.
  *grid = kept->back().second;
  return "";
}

}  // namespace softgym_mj::cloth
