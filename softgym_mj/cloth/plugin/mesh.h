// The surfaces and ropes of the flexes that the plugin moves, as one list of vertices, edges, triangles and hinges.

#ifndef SOFTGYM_MJ_CLOTH_MESH_H_
#define SOFTGYM_MJ_CLOTH_MESH_H_

#include <cstdint>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

namespace softgym_mj::cloth {

// What a flex is made of. Of a rope, forces are not per metre of width, and moments not either.
struct Material {
  double stretch = 1000;  // [N/m] Force per width and strain; of a rope [N].
  double shear = 0.3;     // Stiffness of diagonals as a share of that of other edges.
  double bend = 1e-5;     // [N m] Moment per width and curvature; of a rope [N m^2].
  // [N m] If above 0, a sheet is a plate (see plates.h) that has `bend` along the rest shape's X, or the lines of its
  // grid that are nearest to that; this across them; and at 45 degrees bend_bias, or if that is 0 the mean of both.
  double bend_weft = 0, bend_bias = 0;
  double stretch_damping = 1e-3;     // [s] Dashpots as a multiple of the stiffness.
  double bend_damping = 0.05;        // [s]
  double friction = 0.75;            // Between layers.
  double drag = 0;                   // Coefficient of the air's drag on what moves along its normal.
  double added_mass = 0;             // [kg/m^2] Of air that is moved along with it.
  int contype = 1, conaffinity = 1;  // What geoms it touches, as in MuJoCo.
};

// Where on a triangle a point is: the set of corners it lies between, as bits.
constexpr int kInside = 7;

struct Mesh {
  struct Edge {
    int vertex[2];
    int triangle[2];  // Those it belongs to, or -1.
    int opposite[2];  // The third corners of these.
    double length;    // At rest [m].
    double share;     // Area of its triangles over its squared length.
  };
  struct Triangle {
    int vertex[3];
    int edge[3];  // From each corner to the next one.
    // Bit f is set if feature f (a set of corners) is counted with this triangle and not with another one that
    // shares it.
    std::uint8_t owned;
    double area;  // At rest [m^2].
  };
  // Edges of a rope from end to end, or once around. vertex has one more entry than edge.
  struct Chain {
    std::vector<int> vertex, edge;
  };
  // Second differences K of positions that are 0 where nothing is bent.
  struct Hinge {
    int vertex[4];     // The last one of a rope's stands for none.
    double weight[4];  // K.
    double stiffness;  // [N/m] Of the vector sum of K times position.
    double damping;    // [s]
  };

  std::vector<int> flexes;              // Ids in the model.
  std::vector<Material> materials;      // Of each of them.
  std::vector<int> first;               // First vertex of each of them.
  std::vector<int> part;                // Which of them each vertex belongs to.
  std::vector<double> mass;             // Of each vertex [kg].
  std::vector<double> radius, density;  // Of each flex [m], [kg/m^2] (of a rope [kg/m]).
  std::vector<double> rest;             // Where the vertices are in the model (n, 3) [m].
  std::vector<Edge> edges;
  std::vector<Triangle> triangles;
  std::vector<Chain> chains;
  std::vector<Hinge> hinges;
  // For each pair of flexes, `flexes.size()` squared: largest distance at which they touch [m], friction.
  std::vector<float> thickness, friction;
  // Of each vertex: distance [m] at which features of its own flex touch it, less at slim triangles.
  std::vector<float> vertex_thickness;
  bool has_slim = false;  // Whether one of them is less than the largest of its flex.

  int NumVertices() const { return static_cast<int>(part.size()); }
  int Pair(int v, int w) const { return part[v] * static_cast<int>(flexes.size()) + part[w]; }
};

Mesh MakeMesh(const mjModel* m, const std::vector<int>& flexes, const std::vector<Material>& materials);

// Stiffness of an edge as a spring [N/m].
double EdgeStiffness(const Mesh& mesh, const Mesh::Edge& edge);
// The same if diagonals were as stiff as others.
double FullStiffness(const Mesh& mesh, const Mesh::Edge& edge);

// Everything of the model that the mesh depends on, but the materials, as bytes.
void WriteSignature(const mjModel* m, const std::vector<int>& flexes, std::string* out);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_MESH_H_
