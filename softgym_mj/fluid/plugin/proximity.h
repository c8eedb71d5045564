// Finds the pairs of a vertex and a triangle, and of two edges, that may touch in a step.

#ifndef SOFTGYM_MJ_FLUID_PROXIMITY_H_
#define SOFTGYM_MJ_FLUID_PROXIMITY_H_

#include <vector>

#include "native/closest.h"
#include "contact_kernels.h"
#include "mesh.h"

namespace softgym_mj {

// Where the vertices are at the start of a step, and where they go in it.
struct Motion {
  std::vector<Vector> start;  // [m]
  // Displacement x y z [m] and inverse mass [1/kg] of each, and of one more that does not move.
  std::vector<float> move;

  Vector Move(int v) const { return {move[4 * v], move[4 * v + 1], move[4 * v + 2]}; }
};

// Vertex 0 against the triangle of the others, or edge 0-1 against edge 2-3. What lies between the
// closest points at the start is the sum of weight * position, of length `distance` along `normal`.
struct Pair {
  int vertex[4];
  double weight[4];
  Vector normal;
  double distance;  // [m]
  bool edges;       // Two edges.
  bool counts;      // False if others do its work: of the same closest points, or flat surfaces.
};

// Candidates are pairs whose boxes overlap. They are kept from step to step while every vertex stays in
// its box, so that they cost nothing at rest. What comes out depends on the arguments alone.
class Proximity {
 public:
  // To be called when the mesh has changed.
  void Reset(const Mesh& mesh);
  // The pairs that may come as near as their thickness in this step, in a fixed order.
  void Find(const Mesh& mesh, const Motion& motion, std::vector<Pair>* pairs);
  // Whether no pair but those that Find gave for the displacements `before` can pass through each other,
  // now that they have become those of `motion`.
  bool Vouches(const Mesh& mesh, const Motion& motion, const std::vector<float>& before) const;

 private:
  // Boxes sorted by their low end along one axis.
  struct Boxes {
    int count, axis;
    std::vector<float> low[3], high[3];  // The first is along `axis`.
    std::vector<int> id;
    float widest;  // Along the axis.
    void Sort(const std::vector<float>& boxes, int size, int along);
    BoxView View() const;
  };

  // Whether every vertex stays in its box.
  bool Covers(const Motion& motion) const;
  void Build(const Mesh& mesh, const Motion& motion);
  // Fills the arrays for the quick look.
  void Describe(const Mesh& mesh, const Motion& motion);
  bool IsFlat(const Mesh::Edge& edge, Vector normal) const;
  // Leaves the ids of the boxes in [first, last) that overlap `box` in found_.
  void Overlapping(const Boxes& boxes, int first, int last, const float* box);

  const ContactKernels* kernels_ = nullptr;
  bool built_ = false;
  float reach_ = 0;                // Half the largest distance at which pairs are of interest [m].
  std::vector<float> box_;         // Of every vertex: low x y z, high x y z.
  std::vector<float> scratch_;
  Boxes triangles_, edges_;
  std::vector<int> found_, end_;
  std::vector<int> pairs_;         // Two edges each.
  std::vector<float> edge_[10], triangle_[11];  // As in EdgeView and TriangleView.
  std::vector<int> near_triangle_begin_, near_triangle_;  // Candidates of each vertex.
  std::vector<int> near_edge_begin_, near_edge_;          // Candidates of each edge, after it.
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_PROXIMITY_H_
