// Contact between layers: finds the pairs that may touch in a step, and makes rows of them.

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

// What comes out depends on the arguments alone; what is kept from step to step only saves time.
class Layers {
 public:
  std::vector<Pair> pairs;  // That push.
  Aligned<LayerBlock> blocks;

  // To be called when the mesh has changed.
  void Reset(const Mesh& mesh, const ClothKernels& kernels);
  // Finds the pairs for vertices at `position` with the displacements `move` in the step, four floats each.
  void Find(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move);
  // Makes rows of the pairs: `inverse_mass` of each vertex, 0 if it does not give way. Rows that a chain of at most two
  // of them joins to vertices that `near` marks come first, and those that push first among them.
  void MakeRows(const Mesh& mesh, const AlignedFloats& position, const AlignedFloats& move,
                const std::vector<float>& inverse_mass, const std::vector<bool>& near, float gamma);
  // Sets the gaps for vertices at `position` (n, 3), and forgets all impulses. `after`: what `Keep` has kept.
  void Start(const Mesh& mesh, const double* position, const double* after, int size);
  // By how much others have moved the two sides of a pair after its last sweep, which friction has to undo: without it
  // piles creep. (size, 4): which pair, or 0, and how far [m]. `with_layers`: `now` after the layers' last sweep. Only
  // pairs that push are kept, the last of them if there are more. Of those that are `repeated` it is not known what
  // their like have done.
  void Keep(const Mesh& mesh, const Points& points, const float* with_layers, bool repeated, double* after, int size);

  // Makes the next rows anew: `Find` has been called for other displacements.
  void Forget() { found_once_ = false; }
  // Distance [m] at which a pair touches.
  static float Thickness(const Mesh& mesh, const Pair& pair) {
    const int v = pair.vertex[0], w = pair.vertex[3];
    if (!mesh.has_slim || mesh.part[v] != mesh.part[w]) return mesh.thickness[mesh.Pair(v, w)];
    return cloth::Thickness(mesh.vertex_thickness.data(), pair);
  }
  // All pairs that were found, those too whose work others do: they are what must not pass through each other.
  const std::vector<Pair>& all() const { return found_; }
  // Whether these are all there are: pairs are left out where too many vertices lie in one place or are too fast.
  bool complete() const { return all_pairs_; }
  // Blocks of rows that are near.
  int num_near() const { return num_near_; }
  // Whether one of them, or a marked vertex, is at a vertex.
  bool IsNear(int vertex) const { return near_vertex_[vertex]; }

  // Of each edge: the rope that it belongs to, and where; or -1.
  const std::vector<int>& chain() const { return chain_; }
  const std::vector<int>& place() const { return place_; }
  // Of each vertex: the edge of a rope that it is counted with.
  const std::vector<int>& owner() const { return owner_; }
  // Vertices, triangles and edges, those near at rest near each other, and -1 for empty places.
  const std::vector<int>& vertex_order() const { return vertices_.id; }
  const std::vector<int>& triangle_order() const { return triangles_.id; }
  const std::vector<int>& edge_order() const { return edges_.id; }

 private:
  // Items of one kind and the boxes around them.
  struct Tree {
    std::vector<int> id, corners;  // By place.
    Aligned<Boxes> items, leaves;
    std::vector<float> bounds;
    void Build(const std::vector<int>& items_by_place, const std::vector<int>& vertices, int corners_of_item);
    void Bound(const ClothKernels& kernels, const float* low, const float* high);
    BoxTree View();
  };

  std::vector<int> GroupRows(const Mesh& mesh, const std::vector<bool>& near);
  bool Covers(const AlignedFloats& position, const AlignedFloats& move) const;
  void FindCandidates(const AlignedFloats& position, const AlignedFloats& move);
  // False if there are too many.
  bool Collect(Tree* a, Tree* b, bool same, std::vector<int>* out);
  void Filter(const Scene& scene, const std::vector<int>& candidates,
              int (*filter)(const Scene&, const int*, int, Pair*));
  void FindNormals(const Mesh& mesh, const AlignedFloats& position);

  const ClothKernels* kernels_ = nullptr;
  float reach_ = 0;  // Largest distance at which pairs are of interest [m].
  Tree vertices_, triangles_, edges_;
  std::vector<int> corners_, ends_;  // Of triangles, and of edges.
  std::vector<int> owned_, sides_;   // See PairRules.
  std::vector<int> chain_, place_;
  std::vector<int> owner_;
  std::vector<float> normals_;  // Of triangles.
  AlignedFloats low_, high_;    // Boxes of the vertices that the candidates were found with.
  std::vector<int> triangle_candidates_, edge_candidates_;
  std::vector<Pair> found_;
  bool all_overlaps_ = true, all_pairs_ = true;
  // What pairs and rows were last made of.
  AlignedFloats position_, move_;
  std::vector<float> inverse_mass_;
  std::vector<bool> near_, near_vertex_;
  int num_near_ = 0;
  bool found_once_ = false;
  Coloring coloring_;
  std::vector<int> order_;  // The pair of each lane of the blocks, or -1.
  std::vector<int> row_vertices_;
  std::vector<int> head_, next_;  // Lists of what is kept, by the first of a pair.
  std::vector<double> later_;     // (n, 3) What rows have moved vertices by after the one that is looked at [m].
  std::vector<std::uint8_t> movable_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_LAYERS_H_
