// Inner loops of the solver: rows in blocks of eight lanes, and the search for pairs.
//
// sweeps.h and search.h are compiled once per instruction set (native/simd.h) and selected at run time. Arrays hold
// plain floats and integers; positions and displacements are four floats per vertex, aligned to 16 bytes.
//
// A row is a constraint with violation C [m] that is a spring k with a dashpot beta k, solved implicitly in a substep
// of h seconds: with b = 1 / (1 + beta / h), its impulse J times h [kg m] obeys
//   C(now) - (1 - b) C(before) + J b / (k h^2) = 0,
// where `now` is the time of the row's sweep and `before` the end of its last sweep, a substep ago. A sweep is one
// Gauss-Seidel relaxation. (With C(before) at the start of the substep, as in an implicit step, forces are wrong where
// several rows push a vertex, because later rows have changed C(before) and not yet C(now); cloth stretches twice as
// far.)

#ifndef SOFTGYM_MJ_CLOTH_KERNELS_H_
#define SOFTGYM_MJ_CLOTH_KERNELS_H_

#include <cstdint>

#include "native/shapes.h"

namespace softgym_mj::cloth {

constexpr int kBlock = 8;  // Rows of a block, which have no vertex in common.

// All vertices, and fixed ones that pad their number to a multiple of eight and fill empty lanes.
struct Points {
  int count;          // Padded number of vertices.
  float* now;         // Displacement since the start of the step [m]; inverse mass [1/kg].
  float* before;      // The same at the start of the substep.
  float* drift;       // Acceleration times h^2 [m] without bending.
  float* bent_drift;  // The same with bending.
  float* predicted;   // Scratch memory for bending.
  float* moved;       // Displacement of the last substep [m].
  float* air;         // Normals times the square root of the share of an impulse that goes into added mass.
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

// Constants of edges that stiffen: their stiffness k grows with the elongation, and their dashpot does not.
struct alignas(32) StiffeningBlock {
  float stiffness[kBlock];  // k h^2 at rest [kg].
  float growth[kBlock];     // Relative growth of k per elongation [1/m].
  float mass[kBlock];       // Mean inverse mass w of the ends [1/kg].
  float damping[kBlock];    // Dashpot times h [kg].
};

struct alignas(32) HingeBlock {
  int vertex[4][kBlock];
  float weight[4][kBlock];
  float start[3][kBlock];  // Sum of weight times position at the start of the step [m].
  float gamma[kBlock], keep[kBlock];
  float before[3][kBlock];  // The same sum at the end of the last sweep [m].
};

// Rows of layer contacts, whose normals and weights are constant during a step.
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

// Constants of contact rows.
struct ContactRow {
  float gamma;  // b / (k h^2) [1/kg]
  float b;
  float recovery;      // Largest recovery from an overlap per substep [m].
  float most = 1e30f;  // Largest impulse with a solid [kg m].
};

struct Plane {
  float normal[3];
  float* gap;         // Gap of each vertex at the start of the step [m].
  float* friction;    // Friction coefficient of each vertex.
  float* impulse;     // Impulse of each vertex: along the normal, and friction (four floats).
  const int* blocks;  // First vertices of the blocks of eight that may touch it.
  int num_blocks;
};

// Whether a sweep is the first or the last of its row in the substep.
struct SweepPass {
  bool first, last;
};

// A dynamic or kinematic rigid body. Displacements and impulses are linear and angular, about its center of mass.
struct Rigid {
  double move[6];           // Displacement in the substep [m], [rad].
  double compliance[6][6];  // 0 for a kinematic body.
  bool is_pushable;
  double impulse[6];  // Impulse of the sweep; the reader resets it [kg m], [kg m^2].
  float center[3];    // Center of mass [m].
};

// Rows of contact between a geom and points of triangles, ropes or vertices.
struct alignas(32) SolidBlock {
  int vertex[3][kBlock];
  float weight[3][kBlock];
  float rope[kBlock];  // 1 for a piece of a rope, whose third vertex is unused.
  float friction[kBlock];
  float radius[kBlock];     // Radius of the flex [m].
  float side[kBlock];       // Face 2 axis + (0 low, 1 high) through which a point has entered or would enter a box;
                            // -1 if unknown, -2 if a point inside uses the nearest face.
  float normal[3][kBlock];  // Direction towards the flex.
  float gap[kBlock];        // At the start of the substep [m].
  float mass[kBlock];       // Inverse mass of the vertices, and with the body [1/kg].
  float arm[3][kBlock];     // From the body's center to the point [m].
  float impulse[kBlock];    // [kg m], and what friction holds:
  float held[3][kBlock];
  float total[3][kBlock];  // Impulses of the step so far, in the world frame.
  float pressed[kBlock];   // Their normal parts.
  int active;              // Whether it may touch before the next search.
};

// Signed distances to a mesh with their gradients at nodes (count[2], count[1], count[0], 4), or heights of a
// heightfield (count[1], count[0]).
struct Grid {
  int count[3];
  float low[3];   // First node; of a heightfield its least x, y and z [m].
  float step[3];  // Distances of nodes; of a heightfield along z meters per unit of height [m].
  const float* nodes;
};

struct Geom {
  Shape shape;
  float size[3];
  float pose[12];  // Current position [m] and row-major rotation.
  Grid grid;       // Of meshes and heightfields.
};

// Bounding boxes: leaves of eight items, nodes of eight leaves. Unused lanes hold boxes that overlap nothing.
struct alignas(32) Boxes {
  float low[3][kBlock], high[3][kBlock];
};
struct BoxTree {
  int num_leaves, num_nodes;
  Boxes* items;        // Boxes of items, one entry per leaf.
  Boxes* leaves;       // Boxes of leaves, one entry per node.
  float* bounds;       // Boxes of nodes: low x y z, high x y z.
  const int* id;       // Ids of items, -1 for unused lanes.
  const int* corners;  // Vertices of items by lane, three each, with repetitions.
};

// Two features that may touch: vertex 0 and the triangle of the others, or edge 0-1 and edge 2-3. The vector between
// the closest points is the sum of weight * position, of length `distance` along `normal`.
struct Pair {
  int vertex[4];
  float weight[4];
  float normal[3];
  float distance;       // [m]
  std::int16_t edges;   // 1 for two edges, 0 for a vertex and a triangle.
  std::int16_t region;  // Vertices with nonzero weight as bits; of a triangle only its corners.
  int first, second;    // Ids of the vertex or edge, and of the triangle or edge.
};

struct Scene {
  const float* position;   // Four floats per vertex [m].
  const float* move;       // Displacements in the step [m].
  const int* triangles;    // Three vertices each.
  const int* edges;        // Two vertices each.
  const int* part;         // Flex index of each vertex.
  const float* thickness;  // Contact distance of pairs of flexes [m].
  int num_parts;
  float interest;  // Pairs further apart than this many thicknesses are left out.
};

struct ClothKernels {
  void (*Move)(const Points&);
  // Removes the share of the substep's motion so far that goes into added mass.
  void (*MoveAir)(const Points&);
  void (*Bend)(const Points&, HingeBlock*, int count, float substeps);
  // `stiffening`: one for each block, or null if no edge stiffens.
  void (*SweepEdges)(const Points&, EdgeBlock*, const StiffeningBlock* stiffening, int count);
  void (*SweepLayers)(const Points&, const ContactRow&, LayerBlock*, int count, SweepPass);
  void (*WarmLayers)(const Points&, LayerBlock*, int count, float share);
  void (*SweepPlane)(const Points&, const ContactRow&, const Plane&, SweepPass);
  void (*WarmPlane)(const Points&, const Plane&, float share);
  // Sets normals, gaps and masses at the start of a substep. If `substeps`, the number of substeps to the next search,
  // is not 0, it also searches: with `nearest`, for the points of triangles and ropes nearest to the geom. `start`:
  // four floats per vertex [m].
  void (*FindSolid)(const Points&, const float* start, const Geom&, const Rigid*, SolidBlock*, int count, bool nearest,
                    float substeps);
  void (*SweepSolid)(const Points&, const ContactRow&, SolidBlock*, int count, Rigid*, SweepPass);
  void (*WarmSolid)(const Points&, SolidBlock*, int count, Rigid*, float share);
  // Fills boxes of eight items from the boxes of their corners (low and high, four floats per vertex each).
  void (*BoundItems)(const float* low, const float* high, const int* corners, Boxes* out);
  // Writes pairs of lanes of items with overlapping boxes and no common corner, the first ones if there may be more
  // than `capacity`, which sets `full`.
  int (*Overlap)(const BoxTree& a, const BoxTree& b, bool same, int* out, int capacity, bool* full);
  // Writes the pairs that may touch, up to `count`; returns their number.
  int (*FilterTriangles)(const Scene&, const int* pairs, int count, Pair* out);
  int (*FilterEdges)(const Scene&, const int* pairs, int count, Pair* out);
  // Lists pairs whose sides approach by more than `share` of their distance.
  int (*FindApproaching)(const float* now, const Pair* pairs, int count, float share, int* out);
};

extern const ClothKernels kPortableClothKernels;
#ifdef SOFTGYM_MJ_X86
extern const ClothKernels kAvx2ClothKernels;
#endif

// Returns the fastest kernels for this processor, or the portable ones if SOFTGYM_MJ_SIMD=scalar is set. Results are
// bit-identical.
const ClothKernels& ChooseClothKernels();

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_KERNELS_H_
