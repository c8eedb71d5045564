// The inner loops of the cloth contact, compiled once per instruction set. As in kernels.h: no standard
// containers or algorithms in the files that are.

#ifndef SOFTGYM_MJ_FLUID_CONTACT_KERNELS_H_
#define SOFTGYM_MJ_FLUID_CONTACT_KERNELS_H_

namespace softgym_mj {

// Boxes sorted by their low end along the first axis, which may be any of the three. Padded by 8.
struct BoxView {
  const float* low[3];
  const float* high[3];
  const int* id;
};

constexpr int kLanes = 8;

// Eight rows that have no vertex in common, so that they are solved as one. Each keeps n . r >= least, where
// r is the sum of weight * displacement of up to C vertices; those of four corners with Coulomb friction
// against what remains of r. Impulses are in kg m: mass times displacement in the step.
template <int C>
struct alignas(4 * kLanes) Rows {
  static constexpr int kParts = C == 4 ? 4 : 1;  // Of an impulse: along the normal, then x y z across it.

  int vertex[C][kLanes];
  float weight[C][kLanes];
  float normal[3][kLanes];
  float mass[kLanes];        // Inverse of the sum of weight^2 * inverse mass, and compliance; 0: no row.
  float compliance[kLanes];  // What the row gives way for an impulse [1/kg].
  float least[kLanes];       // [m]
  float lowest[kLanes];      // Impulse along the normal.
  float friction[kLanes];
  float impulse[kParts][kLanes];
  float before[kParts][kLanes];  // Impulse before the last sweep.
  float search[kParts][kLanes];  // What momentum carries on.
};

// Edges or triangles as arrays, for a quick look at many.
struct EdgeView {
  const float* start[3];   // One end [m].
  const float* along[3];   // From it to the other [m].
  const float* move[3];    // Mean displacement [m].
  const float* spread;     // How far an end's displacement is from the mean [m].
};
struct TriangleView {
  const float* centre[3];  // [m]
  const float* normal[3];  // Unit.
  const float* move[3];
  const float* spread;
  const float* radius;     // Of a sphere about the centre that holds the triangle [m].
};

struct ContactKernels {
  // Writes the ids of the boxes in [first, last) that overlap `box` (low x y z, high x y z) to `out`,
  // which has room for 8 more; returns their number.
  int (*Scan)(const BoxView&, int first, int last, const float* box, int* out);
  // Copies those of the `count` edges in `near` to `out` that may come within `reach` of edge e, and more;
  // returns their number. `near` is padded by 8 valid indices, `out` has room for 8 more.
  int (*NearEdges)(const EdgeView&, int e, const int* near, int count, float reach, int* out);
  // The same for triangles and a point that moves.
  int (*NearTriangles)(const TriangleView&, const float* point, const float* move, const int* near,
                       int count, float reach, int* out);
  // One Gauss-Seidel sweep: solves one after the other. `move` holds four floats per vertex: displacement,
  // inverse mass. Returns the sum of the squared changes of impulse.
  float (*SweepRows)(Rows<4>* rows, int count, float* move);
  float (*SweepSprings)(Rows<2>* rows, int count, float* move);
  // After a sweep: goes on along the search directions, times `share`, which then take in the sweep.
  void (*ExtendRows)(Rows<4>* rows, int count, float share, float* move);
  void (*ExtendSprings)(Rows<2>* rows, int count, float share, float* move);
};

extern const ContactKernels kScalarContactKernels;
#ifdef SOFTGYM_MJ_X86
extern const ContactKernels kAvx2ContactKernels;
#endif

// As ChooseKernels in kernels.h.
const ContactKernels& ChooseContactKernels();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONTACT_KERNELS_H_
