#include "cloth/plugin/kernels.h"
#include "cloth/plugin/search.h"
#include "cloth/plugin/solid_sweeps.h"
#include "cloth/plugin/sweeps.h"

namespace softgym_mj::cloth {

const ClothKernels kPortableClothKernels = {
    Move,      MoveAir,    Bend,      SweepEdges, SweepLayers, WarmLayers,      SweepPlane,  WarmPlane,
    FindSolid, SweepSolid, WarmSolid, BoundItems, Overlap,     FilterTriangles, FilterEdges, FindApproaching};

}  // namespace softgym_mj::cloth
