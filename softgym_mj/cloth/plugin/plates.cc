#include "cloth/plugin/plates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kRight = 1e-3;  // Cosine below which an angle is a right one, and lines are parallel to within.
constexpr int kDirections = 8;   // Over which the stiffness of a mesh is averaged: exact, as it is of fourth order.
// Relative residual of the conjugate gradients that find displacements of vertices.
constexpr double kLeft = 1e-3;
constexpr int kMostRounds = 300;
// Weight of narrow strips in the mean stiffness of a mesh: fabrics are measured with strips, sheets are wide.
constexpr double kNarrow = 0.75;
constexpr double kPi = 3.14159265358979323846;

struct Plate {
  double along, across, twist;
  explicit Plate(const Material& material) : along(material.bend), across(material.bend_weft) {
    const double mean = (along + across) / 2, bias = material.bend_bias > 0 ? material.bend_bias : mean;
    twist = std::max(0.0, 2 * bias - mean);
  }
  // Stiffness against bending into a cylinder along a direction (c, s).
  double Across(double c, double s) const {
    return along * c * c * c * c + across * s * s * s * s + 2 * twist * c * c * s * s;
  }
};

Vector At(const Mesh& mesh, int vertex) { return FromArray(&mesh.rest[3 * vertex]); }

// Index in `edge` of the hypotenuse of a right triangle; -1 if the triangle has no right angle.
int Hypotenuse(const Mesh& mesh, const Mesh::Triangle& triangle) {
  for (int k = 0; k < 3; ++k) {
    const double c = mesh.edges[triangle.edge[k]].length, a = mesh.edges[triangle.edge[(k + 1) % 3]].length,
                 b = mesh.edges[triangle.edge[(k + 2) % 3]].length;
    if (std::fabs(a * a + b * b - c * c) <= 2 * kRight * a * b) return k;
  }
  return -1;
}

// A grid of rectangles: lines along two directions, and a diagonal in each cell.
struct Grid {
  std::vector<bool> is_diagonal;  // Whether each edge of the flex is a diagonal.
  std::vector<std::array<std::array<int, 2>, 2>>
      next;                  // Neighbors of each vertex along each direction, back and forth.
  std::vector<double> area;  // Area nearest to each vertex [m^2].
  std::vector<bool> is_cut;  // Whether it lies on a rim that cuts cells in halves.
};

bool FindGrid(const Mesh& mesh, int first_edge, int first_triangle, Grid* grid) {
  grid->is_diagonal.assign(mesh.edges.size(), false);
  grid->area.assign(mesh.part.size(), 0);
  grid->is_cut.assign(mesh.part.size(), false);
  grid->next.assign(mesh.part.size(), {{{-1, -1}, {-1, -1}}});
  for (size_t t = first_triangle; t < mesh.triangles.size(); ++t) {
    const Mesh::Triangle& triangle = mesh.triangles[t];
    const int k = triangle.area > 0 ? Hypotenuse(mesh, triangle) : -1;
    if (k < 0) return false;
    grid->is_diagonal[triangle.edge[k]] = true;
    for (int c = 0; c < 3; ++c) grid->area[triangle.vertex[c]] += triangle.area / (c == (k + 2) % 3 ? 2 : 4);
  }
  Vector direction[2] = {};
  for (size_t e = first_edge; e < mesh.edges.size(); ++e) {
    const Mesh::Edge& edge = mesh.edges[e];
    if (grid->is_diagonal[e]) {
      if (edge.triangle[1] < 0) grid->is_cut[edge.vertex[0]] = grid->is_cut[edge.vertex[1]] = true;
      continue;
    }
    const Vector way = (1 / edge.length) * (At(mesh, edge.vertex[1]) - At(mesh, edge.vertex[0]));
    if (Norm(direction[0]) == 0) {
      // "Along" is the direction nearer to X.
      Vector other = way;
      for (int side : mesh.triangles[edge.triangle[0]].edge) {
        const Mesh::Edge& leg = mesh.edges[side];
        if (grid->is_diagonal[side] || &leg == &edge) continue;
        other = (1 / leg.length) * (At(mesh, leg.vertex[1]) - At(mesh, leg.vertex[0]));
      }
      const bool is_along = std::fabs(way.x) >= std::fabs(other.x);
      direction[0] = is_along ? way : other;
      direction[1] = is_along ? other : way;
    }
    const double along = Dot(way, direction[0]), across = Dot(way, direction[1]);
    const int d = std::fabs(across) > std::fabs(along);
    if (std::fabs(d ? along : across) > kRight || std::fabs(d ? across : along) < 1 - kRight) return false;
    const int forth = (d ? across : along) > 0;
    int& from = grid->next[edge.vertex[0]][d][forth];
    int& to = grid->next[edge.vertex[1]][d][!forth];
    if (from >= 0 || to >= 0) return false;
    from = edge.vertex[1];
    to = edge.vertex[0];
  }
  return true;
}

double Distance(const Mesh& mesh, int v, int w) { return Norm(At(mesh, w) - At(mesh, v)); }

// Adds second differences along the grid lines. A vertex at a rim that cuts cells has a neighbor on one side only; its
// area is added to that neighbor.
void AddLines(const Material& material, const Plate& plate, const Grid& grid, int first, Mesh* mesh) {
  for (int v = first; v < mesh->NumVertices(); ++v) {
    for (int d = 0; d < 2; ++d) {
      const std::array<int, 2>& next = grid.next[v][d];
      if (next[0] < 0 || next[1] < 0) continue;
      double area = grid.area[v];
      for (int side = 0; side < 2; ++side) {
        if (grid.is_cut[next[side]] && grid.next[next[side]][d][side] < 0) area += grid.area[next[side]];
      }
      const double a = Distance(*mesh, next[0], v), b = Distance(*mesh, v, next[1]), l = (a + b) / 2;
      mesh->hinges.push_back({{next[0], v, next[1], -1},
                              {l / a, -l / a - l / b, l / b, 0},
                              (d ? plate.across : plate.along) * area / (l * l * l * l),
                              material.bend_damping});
    }
  }
}

// Adds the difference of the diagonals' midpoints of each cell. Half cells at a rim are added to adjacent cells.
void AddCells(const Material& material, const Plate& plate, const Grid& grid, int first_edge, int first_triangle,
              Mesh* mesh) {
  const auto is_cell = [&](int e) { return grid.is_diagonal[e] && mesh->edges[e].triangle[1] >= 0; };
  const auto cell_of = [&](int t) {
    for (int e : mesh->triangles[t].edge) {
      if (is_cell(e)) return e;
    }
    return -1;
  };
  std::vector<double> area(mesh->edges.size());
  for (int t = first_triangle; t < static_cast<int>(mesh->triangles.size()); ++t) {
    std::vector<int> cells = {cell_of(t)};
    if (cells[0] < 0) {
      cells.clear();
      for (int e : mesh->triangles[t].edge) {
        const int* sides = mesh->edges[e].triangle;
        const int other = sides[sides[0] == t];
        if (other >= 0 && cell_of(other) >= 0) cells.push_back(cell_of(other));
      }
    }
    for (int e : cells) area[e] += mesh->triangles[t].area / static_cast<double>(cells.size());
  }
  for (size_t e = first_edge; e < mesh->edges.size(); ++e) {
    if (!is_cell(static_cast<int>(e))) continue;
    const Mesh::Edge& edge = mesh->edges[e];
    const double own = mesh->triangles[edge.triangle[0]].area + mesh->triangles[edge.triangle[1]].area;
    // 1, 1, -1, -1 times positions is kxy times the area of the cell.
    mesh->hinges.push_back({{edge.vertex[0], edge.vertex[1], edge.opposite[0], edge.opposite[1]},
                            {1, 1, -1, -1},
                            2 * plate.twist * area[e] / (own * own),
                            material.bend_damping});
  }
}

// Values of a hinge for curvatures kxx, kyy and kxy of 1/m.
using Sums = std::array<double, 3>;

// Makes the hinge of an edge, with unscaled stiffness; returns false if the edge lacks a triangle.
bool MakeHinge(const Mesh& mesh, const Mesh::Edge& edge, const Plate& plate, double damping, Mesh::Hinge* hinge,
               Sums* sums) {
  if (edge.triangle[1] < 0) return false;
  const double a = mesh.triangles[edge.triangle[0]].area, b = mesh.triangles[edge.triangle[1]].area;
  const double length = edge.length;
  if (!(length > 0 && std::min(a, b) > 0)) return false;
  const Vector start = At(mesh, edge.vertex[0]);
  const Vector way = (1 / length) * (At(mesh, edge.vertex[1]) - start);
  const double height[2] = {2 * a / length, 2 * b / length};
  // Positions along the edge of the two opposite corners, unfolded.
  double place[2];
  for (int k = 0; k < 2; ++k) place[k] = Dot(At(mesh, edge.opposite[k]) - start, way);
  const Vector side = (1 / height[0]) * (At(mesh, edge.opposite[0]) - start - place[0] * way);
  *hinge = {{edge.vertex[0], edge.vertex[1], edge.opposite[0], edge.opposite[1]},
            {0, 0, -length / height[0], -length / height[1]},
            0,
            damping};
  double along = 0;
  for (int k = 0; k < 2; ++k) {
    hinge->weight[0] += (length - place[k]) / height[k];
    hinge->weight[1] += place[k] / height[k];
    along += length * place[k] * (length - place[k]) / (2 * height[k]);
  }
  const double across = -(a + b), both = length * (place[1] - place[0]);
  // Directions in the surface: along the edge and perpendicular to it.
  const double size = std::hypot(way.x, side.x);
  const double x[2] = {size > kRight ? way.x / size : 1, size > kRight ? side.x / size : 0};
  const double sign = x[0] * side.y - x[1] * way.y < 0 ? -1 : 1;
  const double y[2] = {-sign * x[1], sign * x[0]};
  const double tensors[3][3] = {{x[1] * x[1], x[0] * x[0], x[0] * x[1]},
                                {y[1] * y[1], y[0] * y[0], y[0] * y[1]},
                                {2 * x[1] * y[1], 2 * x[0] * y[0], x[1] * y[0] + x[0] * y[1]}};
  for (int i = 0; i < 3; ++i) (*sums)[i] = across * tensors[i][0] + along * tensors[i][1] + both * tensors[i][2];
  hinge->stiffness = plate.Across(x[1], y[1]) / (a + b);
  return true;
}

// Returns the displacements (n) of vertices that minimize the energy of hinges bent to `sums` (m), by conjugate
// gradients.
std::vector<double> GiveWay(const std::vector<Mesh::Hinge>& hinges, const std::vector<bool>& stays,
                            const std::vector<double>& sums) {
  const size_t count = stays.size();
  const auto spread = [&](const std::vector<double>& forces) {
    std::vector<double> out(count);
    for (size_t i = 0; i < hinges.size(); ++i) {
      for (int k = 0; k < 4; ++k) out[hinges[i].vertex[k]] += hinges[i].stiffness * hinges[i].weight[k] * forces[i];
    }
    for (size_t v = 0; v < count; ++v) out[v] = stays[v] ? 0 : out[v];
    return out;
  };
  const auto inner = [&](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (size_t v = 0; v < count; ++v) sum += a[v] * b[v];
    return sum;
  };
  std::vector<double> place(count), left = spread(sums), bent(hinges.size());
  for (double& r : left) r = -r;
  std::vector<double> way = left;
  double square = inner(left, left);
  const double enough = kLeft * kLeft * square;
  for (int i = 0; i < kMostRounds && square > enough; ++i) {
    for (size_t j = 0; j < hinges.size(); ++j) {
      bent[j] = 0;
      for (int k = 0; k < 4; ++k) bent[j] += hinges[j].weight[k] * way[hinges[j].vertex[k]];
    }
    const std::vector<double> push = spread(bent);
    const double share = square / inner(way, push);
    for (size_t v = 0; v < count; ++v) {
      place[v] += share * way[v];
      left[v] -= share * push[v];
    }
    const double before = square;
    square = inner(left, left);
    for (size_t v = 0; v < count; ++v) way[v] = left[v] + square / before * way[v];
  }
  return place;
}

// Stiffness tensor of curvatures kxx, kyy, kxy.
using Tensor = std::array<Sums, 3>;

// Stiffness times area of the hinges selected by `counts`.
Tensor Stiffness(const std::vector<Mesh::Hinge>& hinges, const std::array<std::vector<double>, 3>& sums,
                 const std::vector<bool>& counts) {
  Tensor out = {};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (size_t e = 0; e < hinges.size(); ++e) {
        if (counts[e]) out[i][j] += hinges[e].stiffness * sums[i][e] * sums[j][e];
      }
    }
  }
  return out;
}

// Mean stiffness over all directions of wide sheets, which bend into cylinders, and narrow strips, which bend freely
// across. 0 if there is a mode without stiffness.
double Mean(const Tensor& b) {
  Tensor inverse;
  double determinant = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int k = (i + 1) % 3, l = (i + 2) % 3, m = (j + 1) % 3, n = (j + 2) % 3;
      inverse[j][i] = b[k][m] * b[l][n] - b[k][n] * b[l][m];
      if (i == 0) determinant += b[0][j] * inverse[j][0];
    }
  }
  if (!(determinant > kLeft * b[0][0] * b[1][1] * b[2][2])) return 0;
  double sum = 0;
  for (int d = 0; d < kDirections; ++d) {
    const double c = std::cos(d * kPi / kDirections), s = std::sin(d * kPi / kDirections);
    const double cylinder[3] = {c * c, s * s, c * s}, moment[3] = {c * c, s * s, 2 * c * s};
    double wide = 0, gives = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        wide += cylinder[i] * b[i][j] * cylinder[j];
        gives += moment[i] * inverse[i][j] / determinant * moment[j];
      }
    }
    sum += (1 - kNarrow) * wide + kNarrow / gives;
  }
  return sum / kDirections;
}

// Marks vertices of the rim and their neighbors, which are kept fixed.
std::vector<bool> Rim(const Mesh& mesh, int first_edge) {
  std::vector<bool> is_rim(mesh.part.size());
  for (size_t e = first_edge; e < mesh.edges.size(); ++e) {
    if (mesh.edges[e].triangle[1] < 0) is_rim[mesh.edges[e].vertex[0]] = is_rim[mesh.edges[e].vertex[1]] = true;
  }
  std::vector<bool> stays = is_rim;
  for (size_t e = first_edge; e < mesh.edges.size(); ++e) {
    const int* v = mesh.edges[e].vertex;
    if (is_rim[v[0]] || is_rim[v[1]]) stays[v[0]] = stays[v[1]] = true;
  }
  return stays;
}

// Adds hinges of the edges of an arbitrary mesh.
void AddEdges(const Material& material, const Plate& plate, int first_edge, int first_triangle, Mesh* mesh) {
  std::vector<Mesh::Hinge> hinges;
  std::array<std::vector<double>, 3> sums;
  const std::vector<bool> stays = Rim(*mesh, first_edge);
  std::vector<bool> gives;
  for (size_t e = first_edge; e < mesh->edges.size(); ++e) {
    Mesh::Hinge hinge;
    Sums own;
    if (!MakeHinge(*mesh, mesh->edges[e], plate, material.bend_damping, &hinge, &own)) continue;
    hinges.push_back(hinge);
    gives.push_back(false);
    for (int v : hinge.vertex) gives.back() = gives.back() || !stays[v];
    for (int i = 0; i < 3; ++i) sums[i].push_back(own[i]);
  }
  double area = 0;
  for (size_t t = first_triangle; t < mesh->triangles.size(); ++t) area += mesh->triangles[t].area;
  const double wanted = area * Mean({{{plate.along, 0, 0}, {0, plate.across, 0}, {0, 0, 2 * plate.twist}}});
  double stored = Mean(Stiffness(hinges, sums, std::vector<bool>(hinges.size(), true)));
  const double before = Mean(Stiffness(hinges, sums, gives));
  for (std::vector<double>& bend : sums) {
    const std::vector<double> moved = GiveWay(hinges, stays, bend);
    for (size_t i = 0; i < hinges.size(); ++i) {
      for (int k = 0; k < 4; ++k) bend[i] += hinges[i].weight[k] * moved[hinges[i].vertex[k]];
    }
  }
  // The rim is scaled like the interior.
  if (before > 0) stored *= Mean(Stiffness(hinges, sums, gives)) / before;
  for (Mesh::Hinge& hinge : hinges) {
    hinge.stiffness *= stored > 0 && wanted > 0 ? wanted / stored : 1;
    mesh->hinges.push_back(hinge);
  }
}

}  // namespace

void AddPlate(const Material& material, int first_edge, int first_triangle, Mesh* mesh) {
  const Plate plate(material);
  Grid grid;
  if (FindGrid(*mesh, first_edge, first_triangle, &grid)) {
    const int first_vertex = mesh->triangles.empty() ? 0 : mesh->first.back();
    AddLines(material, plate, grid, first_vertex, mesh);
    AddCells(material, plate, grid, first_edge, first_triangle, mesh);
  } else {
    AddEdges(material, plate, first_edge, first_triangle, mesh);
  }
}

}  // namespace softgym_mj::cloth
