// Effects of air on surfaces: drag and added mass.

#ifndef SOFTGYM_MJ_CLOTH_AIR_H_
#define SOFTGYM_MJ_CLOTH_AIR_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/planes.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// Adds air drag on triangles along their normals, from their speed at the end of the step.
void AddDrag(const Mesh& mesh, const Start& start, double timestep, std::vector<double>* acceleration);

// A vertex of mass m that moves along its normal carries a mass a of air along unless it touches something: the share
// a / (m + a) of an impulse goes into the air. Touching vertices have no added mass, so that contact bears the weight.
// Fills `air` of `Points`; returns false, without changes, if no flex has added mass.
bool StartAir(const Mesh& mesh, const Start& start, const std::vector<Pair>& pairs, const Planes& planes,
              AlignedFloats* air);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_AIR_H_
