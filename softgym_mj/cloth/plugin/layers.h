// Contact between layers: finds pairs that may touch in a step and makes rows of them.

#ifndef SOFTGYM_MJ_CLOTH_LAYERS_H_
#define SOFTGYM_MJ_CLOTH_LAYERS_H_

#include <cstdint>
#include <vector>

#include "cloth/plugin/coloring.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/pair_rules.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// Results depend on the arguments only; data kept from step to step only saves time.
class Layers {
 public:
  std::vector<Pair> pairs;  // Pushing pairs.
  Aligned<LayerBlock> blocks;

  // Rebuilds the search structures after a change of the mesh.
  void Reset(const Mesh& mesh, const ClothKernels& kernels);
  // Finds pairs for vertices at `position` with displacements `move` in the step, four floats each.
  void Find(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move);
  // Makes rows of the pairs. `inverse_mass`: of each vertex, 0 if it is immovable. Rows within two rows of vertices
  // marked by `near` come first, with pushing ones first among them.
  void MakeRows(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move,
                const std::vector<float>& inverse_mass, const std::vector<bool>& near, float gamma);
  // Sets gaps for vertices at `position` (n, 3) and resets impulses. `after`: result of `Keep`.
  void Start(const Mesh& mesh, const double* position, const double* after, int size);
  // Stores the relative displacement of both sides of a pair after its last sweep, which friction undoes in the next
  // step: without it piles creep. `after` (size, 4): key of a pair, or 0, and displacement [m]. `with_layers`: `now`
  // after the layers' last sweep. Only pushing pairs are stored, the last ones if there are too many. For `repeated`
  // rows the effect of other repeated rows is unknown.
  void Keep(const Mesh& mesh, const Points& points, const float* with_layers, bool repeated, double* after, int size);

  // Discards the rows, because `Find` has been called for other displacements.
  void Forget() { found_once_ = false; }
  // Distance [m] at which a pair touches.
  static float Thickness(const Mesh& mesh, const Pair& pair) {
    const int v = pair.vertex[0], w = pair.vertex[3];
    if (!mesh.has_slim || mesh.part[v] != mesh.part[w]) return mesh.thickness[mesh.Pair(v, w)];
    return cloth::Thickness(mesh.vertex_thickness.data(), pair);
  }
  // All pairs that must not pass through each other, including those without a row.
  const std::vector<Pair>& all() const { return found_; }
  // Whether all pairs were found: some are left out if too many vertices coincide or are too fast.
  bool complete() const { return all_pairs_; }
  // Number of blocks of near rows.
  int num_near() const { return num_near_; }
  // Whether a vertex is marked or part of a near row.
  bool IsNear(int vertex) const { return near_vertex_[vertex]; }

  // Rope of each edge and index in it, or -1.
  const std::vector<int>& chain() const { return chain_; }
  const std::vector<int>& place() const { return place_; }
  // Rope edge that owns each vertex.
  const std::vector<int>& owner() const { return owner_; }
  // Vertices, triangles and edges in spatial order at rest, with -1 for unused lanes.
  const std::vector<int>& vertex_order() const { return vertices_.id; }
  const std::vector<int>& triangle_order() const { return triangles_.id; }
  const std::vector<int>& edge_order() const { return edges_.id; }

 private:
  // Items of one kind and the boxes around them.
  struct Tree {
    std::vector<int> id, corners;  // By lane.
    Aligned<Boxes> items, leaves;
    std::vector<float> bounds;
    void Build(const std::vector<int>& items_by_place, const std::vector<int>& vertices, int corners_of_item);
    void Bound(const ClothKernels& kernels, const float* low, const float* high);
    BoxTree View();
  };

  std::vector<int> GroupRows(const Mesh& mesh, const std::vector<bool>& near);
  bool Covers(const AlignedFloats& position, const AlignedFloats& move) const;
  void FindCandidates(const AlignedFloats& position, const AlignedFloats& move);
  // Returns false if there are too many.
  bool Collect(Tree* a, Tree* b, bool same, std::vector<int>* out);
  void Filter(const Scene& scene, const std::vector<int>& candidates,
              int (*filter)(const Scene&, const int*, int, Pair*));
  void FindNormals(const Mesh& mesh, const AlignedFloats& position);

  const ClothKernels* kernels_ = nullptr;
  float reach_ = 0;  // Largest distance at which pairs are of interest [m].
  Tree vertices_, triangles_, edges_;
  std::vector<int> corners_, ends_;  // Corners of triangles, ends of edges.
  std::vector<int> owned_, sides_;   // As in PairRules.
  std::vector<int> chain_, place_;
  std::vector<int> owner_;
  std::vector<float> normals_;  // Normals of triangles.
  AlignedFloats low_, high_;    // Boxes of the vertices with which the candidates were found.
  std::vector<int> triangle_candidates_, edge_candidates_;
  std::vector<Pair> found_;
  bool all_overlaps_ = true, all_pairs_ = true;
  // Input of the last pairs and rows.
  AlignedFloats position_, move_;
  std::vector<float> inverse_mass_;
  std::vector<bool> near_, near_vertex_;
  int num_near_ = 0;
  bool found_once_ = false;
  Coloring coloring_;
  std::vector<int> order_;  // The pair of each lane of the blocks, or -1.
  std::vector<int> row_vertices_;
  std::vector<int> head_, next_;  // Linked lists of stored pairs by their first item.
  std::vector<double> later_;     // (n, 3) Displacements by rows after the current one [m].
  std::vector<std::uint8_t> movable_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_LAYERS_H_
