// Batched measures on a GPU, one block per simulation.

#include "batch/measures.h"

extern "C" __global__ void CoveredAreas(long long vertices, long long coordinates, long long triangles, long long lines,
                                        const double* points, const long long* corners, double* lengths,
                                        double* areas) {
  softgym_mj::CoverMeshOf(blockIdx.x, vertices, coordinates, triangles, lines, points, corners, lengths, areas);
}

extern "C" __global__ void MatchedDistances(long long count, const double* distances, double* means) {
  softgym_mj::MatchOf(blockIdx.x, count, distances, means);
}
