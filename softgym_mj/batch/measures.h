// Batched measures, one thread group per simulation.

#ifndef SOFTGYM_MJ_BATCH_MEASURES_H_
#define SOFTGYM_MJ_BATCH_MEASURES_H_

#include "batch/covered.h"
#include "batch/matched.h"

namespace softgym_mj {
namespace {

// Covered area of mesh `i` of points (number, vertices, coordinates) and corners (number, triangles, 3).
inline void CoverMeshOf(long long i, long long vertices, long long coordinates, long long triangles, long long lines,
                        const double* points, const long long* corners, double* lengths, double* areas) {
  const TriangleMesh mesh = {coordinates, triangles, points + i * vertices * coordinates, corners + i * 3 * triangles};
  CoverMesh(mesh, lines, lengths + i * lines, areas + i);
}

// Matched distance of matrix `i` of (number, count, count).
inline void MatchOf(long long i, long long count, const double* distances, double* means) {
  Once([&] { means[i] = MatchedDistance(static_cast<int>(count), distances + i * count * count); });
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_MEASURES_H_
