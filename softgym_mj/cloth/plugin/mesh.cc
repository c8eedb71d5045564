#include "cloth/plugin/mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "cloth/plugin/plates.h"
#include "native/flex.h"

namespace softgym_mj::cloth {
namespace {

// Layers of a flex touch at a distance of one diameter, limited to this share of the smallest height of a vertex's
// triangles: in a flat sheet a vertex must not touch the triangles beside it.
constexpr double kMaxThickness = 0.9;
// Stretch stiffness of a grid of springs, with diagonals of 0.3 times the stiffness, relative to that of its rows.
constexpr double kGrid = 1.2;
// Inner edges whose triangles have less than this share of their squared length are diagonals.
constexpr double kDiagonal = 0.75;
// With the stiffness kBend B / length^2 of all hinges, a strip cut from a grid of squares with alternating diagonals
// bends like a plate of rigidity B in every direction, in the limit of long waves: its energy for curvatures k is
// B/2 (3/2) (kxx^2 + kyy^2 + 2 kxy^2 - (kxx + kyy)^2 / 4), of which a free strip keeps B/2 kxx^2 (kyy = kxx / 3).
// The quarter is the compliance of vertices with four edges relative to those with eight. Equilateral triangles: 1.15
// B.
constexpr double kBend = 1.5;

// Area of a triangle with sides a, b, c.
double Heron(double a, double b, double c) {
  const double s = (a + b + c) / 2;
  return std::sqrt(std::max(0.0, s * (s - a) * (s - b) * (s - c)));
}

// Cotangent of the angle between sides a and b, opposite of c, in a triangle of this area.
double Cotangent(double a, double b, double c, double area) { return (a * a + b * b - c * c) / (4 * area); }

void AddTriangles(const mjModel* m, int flex, int first, Mesh* mesh) {
  Mesh::Edge* edges = mesh->edges.data() + mesh->edges.size() - m->flex_edgenum[flex];
  const int first_edge = static_cast<int>(edges - mesh->edges.data());
  std::map<std::pair<int, int>, int> edge_of;
  for (int e = 0; e < m->flex_edgenum[flex]; ++e) {
    edge_of[std::minmax(edges[e].vertex[0], edges[e].vertex[1])] = e;
  }
  std::vector<bool> owned_vertex(mesh->part.size());
  const int* element = m->flex_elem + m->flex_elemdataadr[flex];
  for (int t = 0; t < m->flex_elemnum[flex]; ++t, element += 3) {
    Mesh::Triangle triangle = {{first + element[0], first + element[1], first + element[2]}, {}, 1 << kInside, 0};
    const int index = static_cast<int>(mesh->triangles.size());
    double side[3];
    for (int k = 0; k < 3; ++k) {
      const int v = triangle.vertex[k], w = triangle.vertex[(k + 1) % 3];
      const int e = edge_of[std::minmax(v, w)];
      triangle.edge[k] = first_edge + e;
      side[k] = edges[e].length;
      const int place = edges[e].triangle[0] >= 0;
      edges[e].triangle[place] = index;
      edges[e].opposite[place] = triangle.vertex[(k + 2) % 3];
      if (!owned_vertex[v]) {
        owned_vertex[v] = true;
        triangle.owned |= 1 << (1 << k);
      }
      if (place == 0) triangle.owned |= 1 << ((1 << k) | (1 << (k + 1) % 3));
    }
    triangle.area = Heron(side[0], side[1], side[2]);
    const double height = 2 * triangle.area / std::max({side[0], side[1], side[2]});
    for (int v : triangle.vertex) {
      mesh->vertex_thickness[v] = std::min(mesh->vertex_thickness[v], static_cast<float>(kMaxThickness * height));
    }
    for (int k = 0; k < 3; ++k)
      edges[triangle.edge[k] - first_edge].share += side[k] > 0 ? triangle.area / (side[k] * side[k]) : 0;
    mesh->triangles.push_back(triangle);
  }
}

// Adds hinges of quadratic bending (Bergou et al., A Quadratic Bending Model for Inextensible Surfaces, 2006).
void AddHinges(const Material& material, int first_edge, Mesh* mesh) {
  for (size_t e = first_edge; e < mesh->edges.size(); ++e) {
    const Mesh::Edge& edge = mesh->edges[e];
    if (edge.triangle[1] < 0) continue;
    const double area = std::min(mesh->triangles[edge.triangle[0]].area, mesh->triangles[edge.triangle[1]].area);
    if (!(edge.length > 0 && area > 0)) continue;  // It has no side to bend to.
    Mesh::Hinge hinge = {{edge.vertex[0], edge.vertex[1], edge.opposite[0], edge.opposite[1]},
                         {0, 0, 0, 0},
                         kBend * material.bend / (edge.length * edge.length),
                         material.bend_damping};
    for (int k = 0; k < 2; ++k) {
      const Mesh::Triangle& triangle = mesh->triangles[edge.triangle[k]];
      double to_opposite[2] = {};  // From the two ends of the edge.
      for (int side : triangle.edge) {
        const Mesh::Edge& other = mesh->edges[side];
        if (&other == &edge) continue;
        const bool at_start = other.vertex[0] == edge.vertex[0] || other.vertex[1] == edge.vertex[0];
        to_opposite[at_start ? 0 : 1] = other.length;
      }
      const double at0 = Cotangent(edge.length, to_opposite[0], to_opposite[1], triangle.area);
      const double at1 = Cotangent(edge.length, to_opposite[1], to_opposite[0], triangle.area);
      hinge.weight[0] += at1;
      hinge.weight[1] += at0;
      hinge.weight[2 + k] = -(at0 + at1);
    }
    mesh->hinges.push_back(hinge);
  }
}

// Adds chains of rope edges: from each vertex without exactly two edges to the next such vertex, then closed rings.
void AddChains(const Material& material, int first_edge, Mesh* mesh) {
  std::vector<std::vector<int>> at(mesh->part.size());
  for (size_t e = first_edge; e < mesh->edges.size(); ++e) {
    for (int v : mesh->edges[e].vertex) at[v].push_back(static_cast<int>(e));
  }
  std::vector<bool> taken(mesh->edges.size());
  const auto follow = [&](int vertex, int edge) {
    Mesh::Chain chain;
    chain.vertex.push_back(vertex);
    while (edge >= 0) {
      taken[edge] = true;
      const int* ends = mesh->edges[edge].vertex;
      vertex = ends[0] == vertex ? ends[1] : ends[0];
      chain.edge.push_back(edge);
      chain.vertex.push_back(vertex);
      edge = -1;
      if (at[vertex].size() != 2) break;
      for (int next : at[vertex]) {
        if (!taken[next]) edge = next;
      }
    }
    mesh->chains.push_back(chain);
  };
  for (int pass = 0; pass < 2; ++pass) {
    for (size_t v = 0; v < at.size(); ++v) {
      for (int e : at[v]) {
        if (!taken[e] && (pass == 1 || at[v].size() != 2)) follow(static_cast<int>(v), e);
      }
    }
  }
  for (const Mesh::Chain& chain : mesh->chains) {
    if (chain.edge[0] < first_edge) continue;
    // A ring bends at its first vertex, too, if it twists.
    const size_t size = chain.edge.size(), end = material.twist > 0 && chain.IsRing() ? size + 1 : size;
    for (size_t i = 1; i < end; ++i) {
      const int next = chain.edge[i % size];
      const double a = mesh->edges[chain.edge[i - 1]].length, b = mesh->edges[next].length;
      if (!(a > 0 && b > 0)) continue;
      const double l = (a + b) / 2;
      // The weights of equal pieces are 1, -2, 1.
      mesh->hinges.push_back({{chain.vertex[i - 1], chain.vertex[i], chain.vertex[i < size ? i + 1 : 1], -1},
                              {l / a, -l / a - l / b, l / b, 0},
                              material.bend / (l * l * l),
                              material.bend_damping});
    }
  }
}

// Adds the mass of each vertex of a flex; returns the total. Vertices carried by bodies weigh as much as others.
double AddMasses(const mjModel* m, int flex, Mesh* mesh) {
  const int *body = m->flex_vertbodyid + m->flex_vertadr[flex], count = m->flex_vertnum[flex];
  const int own = static_cast<int>(std::count_if(body, body + count, [&](int b) { return OnSlides(m, b); }));
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += own == 0 || OnSlides(m, body[i]) ? m->body_mass[body[i]] : 0;
  for (int i = 0; i < count; ++i) {
    mesh->mass.push_back(own == 0 || OnSlides(m, body[i]) ? m->body_mass[body[i]] : sum / own);
  }
  return own > 0 && own < count ? sum / own * count : sum;
}

}  // namespace

Mesh MakeMesh(const mjModel* m, const std::vector<int>& flexes, const std::vector<Material>& materials) {
  Mesh mesh;
  mesh.flexes = flexes;
  mesh.materials = materials;
  const int count = static_cast<int>(flexes.size());
  for (int p = 0; p < count; ++p) {
    const int f = flexes[p], first = mesh.NumVertices(), first_edge = static_cast<int>(mesh.edges.size());
    mesh.first.push_back(first);
    mesh.part.insert(mesh.part.end(), m->flex_vertnum[f], p);
    mesh.vertex_thickness.insert(mesh.vertex_thickness.end(), m->flex_vertnum[f],
                                 static_cast<float>(2 * m->flex_radius[f]));
    double size = 0;
    const double mass = AddMasses(m, f, &mesh);
    // Relative to the flex's size, so that the order does not depend on its position.
    for (int i = 0; i < m->flex_vertnum[f]; ++i) {
      const mjtNum* share = m->flex_vert0 + 3 * (m->flex_vertadr[f] + i);
      for (int k = 0; k < 3; ++k) mesh.rest.push_back(2 * m->flex_size[3 * f + k] * share[k] + 4.0 * p);
    }
    for (int e = m->flex_edgeadr[f]; e < m->flex_edgeadr[f] + m->flex_edgenum[f]; ++e) {
      mesh.edges.push_back({{first + m->flex_edge[2 * e], first + m->flex_edge[2 * e + 1]},
                            {-1, -1},
                            {-1, -1},
                            m->flexedge_length0[e],
                            0});
    }
    if (m->flex_dim[f] == 2) {
      const int first_triangle = static_cast<int>(mesh.triangles.size());
      AddTriangles(m, f, first, &mesh);
      if (materials[p].bend_weft > 0) {
        AddPlate(materials[p], first_edge, first_triangle, &mesh);
      } else {
        AddHinges(materials[p], first_edge, &mesh);
      }
    } else {
      AddChains(materials[p], first_edge, &mesh);
    }
    for (const Mesh::Triangle& t : mesh.triangles) size += mesh.part[t.vertex[0]] == p ? t.area : 0;
    for (const Mesh::Edge& e : mesh.edges) size += mesh.part[e.vertex[0]] == p && e.triangle[0] < 0 ? e.length : 0;
    mesh.radius.push_back(m->flex_radius[f]);
    mesh.density.push_back(size > 0 ? mass / size : 0);
  }
  for (int p = 0; p < count; ++p) {
    for (int q = 0; q < count; ++q) {
      const int f = flexes[p], g = flexes[q];
      const float* own = mesh.vertex_thickness.data() + mesh.first[p];
      const auto [least, most] = std::minmax_element(own, own + m->flex_vertnum[f]);
      mesh.has_slim |= *least < *most;
      mesh.thickness.push_back(p == q ? *most : static_cast<float>(m->flex_radius[f] + m->flex_radius[g]));
      mesh.friction.push_back(static_cast<float>(std::max(materials[p].friction, materials[q].friction)));
    }
  }
  return mesh;
}

double FullStiffness(const Mesh& mesh, const Mesh::Edge& edge) {
  const Material& material = mesh.materials[mesh.part[edge.vertex[0]]];
  return edge.triangle[0] < 0 ? material.stretch / edge.length : material.stretch / kGrid * edge.share;
}

double EdgeStiffness(const Mesh& mesh, const Mesh::Edge& edge) {
  const bool diagonal = edge.share < kDiagonal && edge.triangle[1] >= 0;
  return FullStiffness(mesh, edge) * (diagonal ? mesh.materials[mesh.part[edge.vertex[0]]].shear : 1);
}

void WriteSignature(const mjModel* m, const std::vector<int>& flexes, std::string* out) {
  out->clear();
  const auto append = [out](const void* data, size_t size) { out->append(static_cast<const char*>(data), size); };
  for (int f : flexes) {
    const int dim = m->flex_dim[f], edge = m->flex_edgeadr[f], edges = m->flex_edgenum[f];
    const int sizes[] = {f, dim, m->flex_vertnum[f], edges, m->flex_elemnum[f]};
    append(sizes, sizeof(sizes));
    append(m->flex_edge + 2 * edge, 2 * edges * sizeof(int));
    append(m->flex_elem + m->flex_elemdataadr[f], (dim + 1) * m->flex_elemnum[f] * sizeof(int));
    append(m->flexedge_length0 + edge, edges * sizeof(mjtNum));
    append(m->flex_radius + f, sizeof(mjtNum));
    for (int i = 0; i < m->flex_vertnum[f]; ++i) {
      append(m->body_mass + m->flex_vertbodyid[m->flex_vertadr[f] + i], sizeof(mjtNum));
    }
  }
}

}  // namespace softgym_mj::cloth
