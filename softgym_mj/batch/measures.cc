#include "batch/measures.h"

#include "native/export.h"

// CPU versions of the kernels of measures.cu; `number`: number of meshes or matrices.
SGM_EXPORT void softgym_mj_covered_areas(long long number, long long vertices, long long coordinates,
                                         long long triangles, long long lines, const double* points,
                                         const long long* corners, double* lengths, double* areas) {
  for (long long i = 0; i < number; ++i) {
    softgym_mj::CoverMeshOf(i, vertices, coordinates, triangles, lines, points, corners, lengths, areas);
  }
}

SGM_EXPORT long long softgym_mj_covered_parts(long long coordinates, long long triangles, long long lines,
                                              double bottom, double pitch, const double* points,
                                              const long long* corners, double* parts) {
  return softgym_mj::CoveredParts({coordinates, triangles, points, corners}, {bottom, pitch}, static_cast<int>(lines),
                                  parts);
}

SGM_EXPORT void softgym_mj_matched_distances(long long number, long long count, const double* distances,
                                             double* means) {
  for (long long i = 0; i < number; ++i) softgym_mj::MatchOf(i, count, distances, means);
}
