#include "mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "native/coloring.h"

namespace softgym_mj {
namespace {

// Layers of the same flex are kept a diameter apart, but no further than this share of the smallest
// height of a triangle: a vertex must not touch its neighbour's triangle in a flat cloth.
constexpr double kMaxThickness = 0.9;

double SmallestHeight(const mjModel* m, int flex) {
  if (m->flex_dim[flex] != 2) return std::numeric_limits<double>::infinity();
  double smallest = std::numeric_limits<double>::infinity();
  const double* length = m->flexedge_length0 + m->flex_edgeadr[flex];
  const int* side = m->flex_elemedge + m->flex_elemedgeadr[flex];
  for (int t = 0; t < m->flex_elemnum[flex]; ++t, side += 3) {
    const double a = length[side[0]], b = length[side[1]], c = length[side[2]];
    const double s = (a + b + c) / 2;
    const double area = std::sqrt(std::max(0.0, s * (s - a) * (s - b) * (s - c)));
    smallest = std::min(smallest, 2 * area / std::max({a, b, c}));
  }
  return smallest;
}

// Stiffness and damping of the edges of a flex as springs: the diagonal of the engine's elasticity, in
// which an element's energy is k_ij e_i e_j / 4 in the changes e of its squared edge lengths.
void SetElasticity(const mjModel* m, int flex, Mesh::Edge* edges) {
  const double* length = m->flexedge_length0 + m->flex_edgeadr[flex];
  for (int e = 0; e < m->flex_edgenum[flex]; ++e) {
    edges[e].stiffness = m->flex_edgestiffness[flex];
    edges[e].damping = m->flex_edgedamping[flex];
    if (m->flex_edgeequality[flex] == 1) {
      edges[e].stiffness = std::numeric_limits<double>::infinity();
    }
  }
  if (m->flex_dim[flex] != 2 || m->flex_stiffnessadr[flex] < 0) return;
  constexpr int kDiagonal[3] = {0, 3, 5};
  const double* k = m->flex_stiffness + m->flex_stiffnessadr[flex];
  const int* edge = m->flex_elemedge + m->flex_elemedgeadr[flex];
  for (int t = 0; t < m->flex_elemnum[flex]; ++t, k += kStiffnessSize, edge += 3) {
    for (int i = 0; i < 3; ++i) {
      const double stiffness = 2 * length[edge[i]] * length[edge[i]] * k[kDiagonal[i]];
      edges[edge[i]].stiffness += stiffness;
      edges[edge[i]].damping += stiffness * m->flex_damping[flex];
    }
  }
}

}  // namespace

Mesh MakeMesh(const mjModel* m, const std::vector<int>& flexes) {
  Mesh mesh;
  mesh.flexes = flexes;
  const int count = static_cast<int>(flexes.size());
  std::map<std::pair<int, int>, int> edge_owner;
  std::vector<int> vertex_owner;
  for (int p = 0; p < count; ++p) {
    const int f = flexes[p], first = mesh.NumVertices();
    mesh.first.push_back(first);
    mesh.part.insert(mesh.part.end(), m->flex_vertnum[f], p);
    vertex_owner.resize(mesh.part.size(), -1);
    for (int e = m->flex_edgeadr[f]; e < m->flex_edgeadr[f] + m->flex_edgenum[f]; ++e) {
      mesh.edges.push_back({{first + m->flex_edge[2 * e], first + m->flex_edge[2 * e + 1]},
                            {-1, -1}, m->flexedge_length0[e], 0, 0});
    }
    SetElasticity(m, f, mesh.edges.data() + mesh.edges.size() - m->flex_edgenum[f]);
    if (m->flex_dim[f] != 2) continue;
    Mesh::Edge* edges = mesh.edges.data() + mesh.edges.size() - m->flex_edgenum[f];
    const int* element = m->flex_elem + m->flex_elemdataadr[f];
    const int* side = m->flex_elemedge + m->flex_elemedgeadr[f];
    for (int t = 0; t < m->flex_elemnum[f]; ++t, element += 3, side += 3) {
      Mesh::Triangle triangle = {{first + element[0], first + element[1], first + element[2]},
                                 1 << kInside};
      const int index = static_cast<int>(mesh.triangles.size());
      for (int k = 0; k < 3; ++k) {
        int* of_edge = edges[side[k]].triangle;
        of_edge[of_edge[0] >= 0] = index;
        const int v = triangle.vertex[k], w = triangle.vertex[(k + 1) % 3];
        if (vertex_owner[v] < 0) {
          vertex_owner[v] = index;
          triangle.owned |= 1 << (1 << k);
        }
        if (edge_owner.emplace(std::minmax(v, w), index).second) {
          triangle.owned |= 1 << ((1 << k) | (1 << (k + 1) % 3));
        }
      }
      mesh.triangles.push_back(triangle);
    }
  }
  std::vector<int> ends;
  for (const Mesh::Edge& edge : mesh.edges) ends.insert(ends.end(), edge.vertex, edge.vertex + 2);
  Coloring().Order(ends, 2, mesh.NumVertices(), &mesh.edge_groups);
  for (int p = 0; p < count; ++p) {
    for (int q = 0; q < count; ++q) {
      const int f = flexes[p], g = flexes[q];
      double thickness = m->flex_radius[f] + m->flex_radius[g];
      if (p == q) thickness = std::min(thickness, kMaxThickness * SmallestHeight(m, f));
      mesh.thickness.push_back(static_cast<float>(thickness));
      const bool slides = m->flex_condim[f] == 1 && m->flex_condim[g] == 1;
      mesh.friction.push_back(static_cast<float>(
          slides ? 0 : std::max(m->flex_friction[3 * f], m->flex_friction[3 * g])));
    }
  }
  return mesh;
}

void WriteSignature(const mjModel* m, const std::vector<int>& flexes, std::string* out) {
  out->clear();
  const auto append = [out](const void* data, size_t size) {
    out->append(static_cast<const char*>(data), size);
  };
  for (int f : flexes) {
    const int verts = m->flex_vertnum[f];
    const int edge = m->flex_edgeadr[f], edges = m->flex_edgenum[f];
    const int dim = m->flex_dim[f];
    const int elements = m->flex_elemnum[f], stiffness = m->flex_stiffnessadr[f];
    const int sizes[] = {f, dim, verts, edges, elements, m->flex_condim[f], m->flex_edgeequality[f]};
    append(sizes, sizeof(sizes));
    append(m->flex_edge + 2 * edge, 2 * edges * sizeof(int));
    append(m->flex_elem + m->flex_elemdataadr[f], (dim + 1) * elements * sizeof(int));
    if (dim == 2) append(m->flex_elemedge + m->flex_elemedgeadr[f], 3 * elements * sizeof(int));
    append(m->flexedge_length0 + edge, edges * sizeof(mjtNum));
    append(m->flex_radius + f, sizeof(mjtNum));
    append(m->flex_friction + 3 * f, sizeof(mjtNum));
    append(m->flex_damping + f, sizeof(mjtNum));
    append(m->flex_edgestiffness + f, sizeof(mjtNum));
    append(m->flex_edgedamping + f, sizeof(mjtNum));
    for (int t = 0; dim == 2 && stiffness >= 0 && t < elements; ++t) {
      append(m->flex_stiffness + stiffness + kStiffnessSize * t, 6 * sizeof(mjtNum));
    }
  }
}

}  // namespace softgym_mj
