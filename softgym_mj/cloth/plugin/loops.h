// CPU loops over blocks of rows, for `ClothKernels`.

#ifndef SOFTGYM_MJ_CLOTH_LOOPS_H_
#define SOFTGYM_MJ_CLOTH_LOOPS_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/search_loops.h"
#include "cloth/plugin/solid_sweeps.h"
#include "cloth/plugin/sweeps.h"

namespace softgym_mj::cloth {
namespace {

inline void MoveAll(const Points& points) {
  for (int i = 0; i < 4 * points.count; i += kLanes) Move(points, i);
}
inline void MoveAllAir(const Points& points) {
  for (int first = 0; first < points.count; first += kBlock) MoveAir(points, first);
}
inline void BendAll(const Points& points, HingeBlock* blocks, int count, float substeps) {
  for (int i = 0; i < 4 * points.count; i += kLanes) Unbent(points, i, substeps).Store(points.predicted + i);
  for (int b = 0; b < count; ++b) SweepHinges(points, blocks + b);
  for (int i = 0; i < 4 * points.count; i += kLanes) SpreadBend(points, i, substeps);
}
inline void SweepAllEdges(const Points& points, EdgeBlock* blocks, const StiffeningBlock* stiffening, int count) {
  for (int b = 0; b < count; ++b) SweepEdges(points, blocks + b, stiffening ? stiffening + b : nullptr);
}
inline void SweepAllLayers(const Points& points, const ContactRow& row, LayerBlock* blocks, int count, SweepPass pass) {
  for (int b = 0; b < count; ++b) SweepLayers(points, row, blocks + b, pass);
}
inline void WarmAllLayers(const Points& points, LayerBlock* blocks, int count, float share) {
  for (int b = 0; b < count; ++b) WarmLayers(points, blocks + b, share);
}
inline void SweepWholePlane(const Points& points, const ContactRow& row, const Plane& plane, SweepPass pass) {
  for (int i = 0; i < plane.num_blocks; ++i) SweepPlane(points, row, plane, plane.blocks[i], pass);
}
inline void WarmWholePlane(const Points& points, const Plane& plane, float share) {
  for (int i = 0; i < plane.num_blocks; ++i) WarmPlane(points, plane, plane.blocks[i], share);
}
inline void FindAllSolid(const Points& points, const float* start, const Geom& geom, const Rigid* body,
                         SolidBlock* blocks, int count, bool nearest, float substeps) {
  for (int b = 0; b < count; ++b) FindSolid(points, start, geom, body, blocks + b, nearest, substeps);
}
inline void SweepAllSolid(const Points& points, const ContactRow& row, SolidBlock* blocks, int count, Rigid* body,
                          SweepPass pass) {
  for (int b = 0; b < count; ++b) SweepSolid(points, row, blocks + b, body, pass);
}
inline void WarmAllSolid(const Points& points, SolidBlock* blocks, int count, Rigid* body, float share) {
  for (int b = 0; b < count; ++b) WarmSolid(points, blocks + b, body, share);
}

constexpr ClothKernels kLoops = {MoveAll,        MoveAllAir,      BendAll,         SweepAllEdges,
                                 SweepAllLayers, WarmAllLayers,   SweepWholePlane, WarmWholePlane,
                                 FindAllSolid,   SweepAllSolid,   WarmAllSolid,    BoundItems,
                                 Overlap,        FilterTriangles, FilterEdges,     FindApproaching};

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_LOOPS_H_
