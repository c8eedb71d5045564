// Surfaces and ropes of the plugin's flexes as one list of vertices, edges, triangles and hinges.

#ifndef SOFTGYM_MJ_CLOTH_MESH_H_
#define SOFTGYM_MJ_CLOTH_MESH_H_

#include <cstdint>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

namespace softgym_mj::cloth {

// Material of a flex. Forces and moments of a rope are not per width.
struct Material {
  double stretch = 1000;  // [N/m] Force per width and strain; of a rope [N].
  double shear = 0.3;     // Stiffness of diagonals as a share of that of other edges.
  double bend = 1e-5;     // [N m] Moment per width and curvature; of a rope [N m^2].
  // [N m] If bend_weft is above 0, a sheet bends as an orthotropic plate (plates.h): `bend` along the rest shape's X or
  // the grid lines nearest to it, bend_weft across, and bend_bias, or if 0 their mean, at 45 degrees.
  double bend_weft = 0, bend_bias = 0;
  double stiffening = 0;             // Relative growth of the stretch stiffness of surfaces per strain in tension.
  double stretch_damping = 1e-3;     // [s] Dashpots as a multiple of the stiffness.
  double bend_damping = 0.05;        // [s]
  double friction = 0.75;            // Between layers.
  double drag = 0;                   // Coefficient of the air's drag on what moves along its normal.
  double added_mass = 0;             // [kg/m^2] Of air that is moved along with it.
  int contype = 1, conaffinity = 1;  // Geoms that it touches, as in MuJoCo.
  double twist = 0;                  // [N m^2] Of a rope, moment per twist; 0 disables twist (twist.h).
  // Whether the frames of both ends are held. If 0, those of held vertices are, and a free end unwinds the rope.
  int twist_clamped = 0;
};

// Region of a point on a triangle: the set of corners with weight, as bits.
constexpr int kInside = 7;

struct Mesh {
  struct Edge {
    int vertex[2];
    int triangle[2];  // Its triangles, or -1.
    int opposite[2];  // Their third corners.
    double length;    // Rest length [m].
    double share;     // Area of its triangles over its squared length.
  };
  struct Triangle {
    int vertex[3];
    int edge[3];  // From each corner to the next one.
    // Bit f is set if this triangle owns feature f (a set of corners) among the triangles that share it.
    std::uint8_t owned;
    double area;  // At rest [m^2].
  };
  // Edges of a rope from end to end, or once around. vertex has one more entry than edge.
  struct Chain {
    std::vector<int> vertex, edge;

    bool IsRing() const { return vertex.front() == vertex.back(); }
  };
  // A bending element: a linear combination K of positions that is 0 in the unbent state.
  struct Hinge {
    int vertex[4];     // The last one is unused for ropes.
    double weight[4];  // K.
    double stiffness;  // [N/m] Stiffness against the vector K times position.
    double damping;    // [s]
  };

  std::vector<int> flexes;              // Flex ids in the model.
  std::vector<Material> materials;      // Material of each flex.
  std::vector<int> first;               // First vertex of each flex.
  std::vector<int> part;                // Index of the flex of each vertex.
  std::vector<double> mass;             // Mass of each vertex [kg].
  std::vector<double> radius, density;  // Of each flex [m], [kg/m^2]; ropes have [kg/m].
  std::vector<double> rest;             // Rest positions of vertices (n, 3) [m].
  std::vector<Edge> edges;
  std::vector<Triangle> triangles;
  std::vector<Chain> chains;
  std::vector<Hinge> hinges;
  // For each pair of flexes, `flexes.size()` squared: largest distance at which they touch [m], friction.
  std::vector<float> thickness, friction;
  // Contact distance of each vertex to features of its own flex [m], smaller at slim triangles.
  std::vector<float> vertex_thickness;
  bool has_slim = false;  // Whether these differ within a flex.

  int NumVertices() const { return static_cast<int>(part.size()); }
  int Pair(int v, int w) const { return part[v] * static_cast<int>(flexes.size()) + part[w]; }
};

Mesh MakeMesh(const mjModel* m, const std::vector<int>& flexes, const std::vector<Material>& materials);

// Stiffness of an edge as a spring [N/m].
double EdgeStiffness(const Mesh& mesh, const Mesh::Edge& edge);
// Stiffness of an edge [N/m] if diagonals were as stiff as other edges.
double FullStiffness(const Mesh& mesh, const Mesh::Edge& edge);

// Writes everything in the model that determines the mesh, except materials, as bytes.
void WriteSignature(const mjModel* m, const std::vector<int>& flexes, std::string* out);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MESH_H_
