// The inner loops of the solver: rows in blocks of eight lanes, and the search for pairs.
//
// sweeps.h and search.h are compiled once per instruction set (see native/simd.h), and chosen from at run time. All
// arrays are plain floats and integers; positions and displacements are four floats a vertex, on 16 bytes.
//
// A row is a constraint with violation C [m] that is a spring k with a dashpot beta k, solved implicitly in a substep
// of h seconds: with b = 1 / (1 + beta / h), its impulse J times h [kg m] obeys
//   C(now) - (1 - b) C(before) + J b / (k h^2) = 0,
// where `now` is at the row's sweep, and `before` was the end of its last sweep, a substep ago. One relaxation of
// Gauss and Seidel a sweep. (With C(before) at the start of the substep instead, which is what an implicit step means,
// forces are wrong where several rows push a vertex, as rows after this one have changed C(before) and not yet C(now);
// and cloth stretches twice as far.)

#ifndef SOFTGYM_MJ_CLOTH_KERNELS_H_
#define SOFTGYM_MJ_CLOTH_KERNELS_H_

#include <cstdint>

#include "native/shapes.h"

namespace softgym_mj::cloth {

constexpr int kBlock = 8;  // Rows of a block, which have no vertex in common.

// All vertices and one more that never moves, which fills blocks, up to a multiple of eight.
struct Points {
  int count;          // Padded.
  float* now;         // Displacement since the start of the step [m]; inverse mass [1/kg].
  float* before;      // The same at the start of the substep.
  float* drift;       // Acceleration times h^2 [m], without and
  float* bent_drift;  // with bending.
  float* predicted;   // Scratch for bending.
  float* moved;       // Displacement of the last substep [m].
  const float* air;   // Normals times the root of the share of a push that goes into the air moved along.
};

struct alignas(32) EdgeBlock {
  int vertex[2][kBlock];
  float start[3][kBlock];  // From the second to the first vertex at the start of the step [m].
  float length[kBlock];    // At rest [m].
  float gamma[kBlock];     // b / (k h^2) [1/kg].
  float keep[kBlock];      // 1 - b.
  float before[kBlock];    // Length at the end of the last sweep [m].
  float impulse[kBlock];   // [kg m]
};

struct alignas(32) HingeBlock {
  int vertex[4][kBlock];
  float weight[4][kBlock];
  float start[3][kBlock];  // Their sum of weight times position at the start of the step [m].
  float gamma[kBlock], keep[kBlock];
  float before[3][kBlock];  // The same sum at the end of the last sweep [m].
};

// Rows of pairs of layers, whose normals and weights stay for a step.
struct alignas(32) LayerBlock {
  int vertex[4][kBlock];
  float weight[4][kBlock];
  float normal[3][kBlock];
  float gap[kBlock];  // At the start of the step [m].
  float friction[kBlock];
  float mass[kBlock];       // Inverse mass: sum of weight^2 / mass [1/kg].
  float inverse[kBlock];    // 1 / (mass + gamma).
  float before[3][kBlock];  // Sum of weight times displacement at the end of the last sweep [m].
  float impulse[kBlock];    // [kg m], and what friction holds:
  float held[3][kBlock];
};

// Of the rows of contacts.
struct ContactRow {
  float gamma;  // b / (k h^2) [1/kg]
  float b;
  float recovery;      // Largest way out of an overlap in a substep [m].
  float most = 1e30f;  // Largest impulse with a solid [kg m].
};

struct Plane {
  float normal[3];
  float* gap;         // Of each vertex at the start of the step [m].
  float* friction;    // Of each vertex.
  float* impulse;     // Of each vertex: along the normal, and what friction holds: four floats.
  const int* blocks;  // First vertices of the blocks of eight that may touch it.
  int num_blocks;
};

// Whether a sweep is the first or the last of its row in the substep.
struct SweepPass {
  bool first, last;
};

// A rigid body that gives way, or moves as it is told to. Displacements and impulses are linear and angular, about its
// centre of mass.
struct Rigid {
  double move[6];           // In the substep [m], [rad].
  double compliance[6][6];  // 0 of one that does not give way.
  bool gives_way;
  double impulse[6];  // In the sweep, to be emptied by whoever reads it [kg m], [kg m^2].
  float centre[3];    // [m]
};

// Rows of a geom and points of triangles, of ropes or of vertices.
struct alignas(32) SolidBlock {
  int vertex[3][kBlock];
  float weight[3][kBlock];
  float rope[kBlock];  // 1 for a piece of a rope, whose third vertex stands for none.
  float friction[kBlock];
  float radius[kBlock];     // Of the flex [m].
  float side[kBlock];       // Of a box: the face 2 axis + (0 low, 1 high) by which a point has come or would come in;
                            // -1 before it is known, -2 if a point inside belongs to the nearest one.
  float normal[3][kBlock];  // Towards the flex.
  float gap[kBlock];        // At the start of the substep [m].
  float mass[kBlock];       // Inverse mass of the vertices, and with the body [1/kg].
  float arm[3][kBlock];     // From the body's centre to the point [m].
  float impulse[kBlock];    // [kg m], and what friction holds:
  float held[3][kBlock];
  float total[3][kBlock];  // Impulses of the step so far, in the world.
  float pressed[kBlock];   // Their normal parts.
  int active;              // Whether it may touch before the next search.
};

struct Geom {
  Shape shape;
  float size[3];
  float pose[12];  // Position [m] and row-major rotation now.
};

// Boxes in leaves of eight items, nodes of eight leaves. Empty places hold boxes that overlap nothing.
struct alignas(32) Boxes {
  float low[3][kBlock], high[3][kBlock];
};
struct BoxTree {
  int num_leaves, num_nodes;
  Boxes* items;        // One a leaf.
  Boxes* leaves;       // One a node.
  float* bounds;       // Of the nodes: low x y z, high x y z.
  const int* id;       // Of the items, -1 for empty places.
  const int* corners;  // Vertices of the items by place, three each; some may be the same.
};

// Two features that may touch. Vertex 0 against the triangle of the others, or edge 0-1 against edge 2-3. What lies
// between the closest points is the sum of weight * position, of length `distance` along `normal`.
struct Pair {
  int vertex[4];
  float weight[4];
  float normal[3];
  float distance;       // [m]
  std::int16_t edges;   // Whether it is two edges.
  std::int16_t region;  // The vertices with a weight, as bits; of a triangle only its corners.
  int first, second;    // Ids of the vertex or edge, and of the triangle or edge.
};

struct Scene {
  const float* position;   // Four floats a vertex [m].
  const float* move;       // Displacements in the step [m].
  const int* triangles;    // Three vertices each.
  const int* edges;        // Two vertices each.
  const int* part;         // Of each vertex.
  const float* thickness;  // Of pairs of parts [m].
  int num_parts;
  float interest;  // Pairs further apart than this many thicknesses are left out.
};

struct ClothKernels {
  void (*Move)(const Points&);
  // Takes from what was gained in the substep so far what the air moved along gets of it.
  void (*MoveAir)(const Points&);
  void (*Bend)(const Points&, HingeBlock*, int count, float substeps);
  void (*SweepEdges)(const Points&, EdgeBlock*, int count);
  void (*SweepLayers)(const Points&, const ContactRow&, LayerBlock*, int count, SweepPass);
  void (*WarmLayers)(const Points&, LayerBlock*, int count, float share);
  void (*SweepPlane)(const Points&, const ContactRow&, const Plane&, SweepPass);
  void (*WarmPlane)(const Points&, const Plane&, float share);
  // Sets normals, gaps and masses for the start of the substep. With the number of substeps to the next search, instead
  // of 0, it is one: with `nearest`, points of triangles and ropes become those where they are nearest to the geom.
  // `start`: four floats a vertex [m].
  void (*FindSolid)(const Points&, const float* start, const Geom&, const Rigid*, SolidBlock*, int count, bool nearest,
                    float substeps);
  void (*SweepSolid)(const Points&, const ContactRow&, SolidBlock*, int count, Rigid*, SweepPass);
  void (*WarmSolid)(const Points&, SolidBlock*, int count, Rigid*, float share);
  // Fills boxes of eight items: those of the corners' boxes (low and high, four floats a vertex each).
  void (*BoundItems)(const float* low, const float* high, const int* corners, Boxes* out);
  // Pairs of places of items whose boxes overlap and that share no corner: those that come first if there may be more
  // than `capacity`, in which case it is `full`.
  int (*Overlap)(const BoxTree& a, const BoxTree& b, bool same, int* out, int capacity, bool* full);
  // Writes the pairs that may touch; returns their number. There is room for `count`.
  int (*FilterTriangles)(const Scene&, const int* pairs, int count, Pair* out);
  int (*FilterEdges)(const Scene&, const int* pairs, int count, Pair* out);
  // Marks what may pass through each other: whose sides approach by more than `share` of their distance.
  int (*FindApproaching)(const float* now, const Pair* pairs, int count, float share, int* out);
};

extern const ClothKernels kPortableClothKernels;
#ifdef SOFTGYM_MJ_X86
extern const ClothKernels kAvx2ClothKernels;
#endif

// The fastest ones that this processor can run; portable ones if the environment has SOFTGYM_MJ_SIMD=scalar. Their
// results have the same bits.
const ClothKernels& ChooseClothKernels();

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_KERNELS_H_
