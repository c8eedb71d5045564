// The surfaces and cords of one or more flexes as one list of vertices, edges and triangles.

#ifndef SOFTGYM_MJ_FLUID_MESH_H_
#define SOFTGYM_MJ_FLUID_MESH_H_

#include <cstdint>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

namespace softgym_mj {

// Where on a triangle a point is: the set of corners it lies between, as bits.
constexpr int kInside = 7;

struct Mesh {
  struct Edge {
    int vertex[2];
    int triangle[2];     // Those it belongs to, or -1.
    double length;       // At rest [m].
    double stiffness;    // [N/m]; infinite if an equality keeps the length.
    double damping;      // [N s/m]

    bool OnSurface() const { return triangle[0] >= 0; }
  };
  struct Triangle {
    int vertex[3];
    // Bit f is set if feature f (a set of corners) is counted with this triangle and not with another
    // one that shares it.
    std::uint8_t owned;
  };

  std::vector<int> flexes;  // Ids in the model.
  std::vector<int> first;   // First vertex of each of them.
  std::vector<int> part;    // Which of them each vertex belongs to.
  std::vector<Edge> edges;
  std::vector<int> edge_groups;  // Indices of edges, eight at a time without a common vertex; or -1.
  std::vector<Triangle> triangles;
  // For each pair of flexes, `flexes.size()` squared: distance at which they touch [m], friction.
  std::vector<float> thickness, friction;

  int NumVertices() const { return static_cast<int>(part.size()); }
  int Pair(int v, int w) const { return part[v] * static_cast<int>(flexes.size()) + part[w]; }
};

// Numbers per triangle in mjModel.flex_stiffness; the first six are the upper triangle of a 3 x 3 matrix.
constexpr int kStiffnessSize = 21;

Mesh MakeMesh(const mjModel* m, const std::vector<int>& flexes);

// Everything of the model that the mesh depends on, as bytes.
void WriteSignature(const mjModel* m, const std::vector<int>& flexes, std::string* out);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_MESH_H_
