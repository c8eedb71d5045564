// What the air does to surfaces: its drag, and its mass that they take along.

#ifndef SOFTGYM_MJ_CLOTH_AIR_H_
#define SOFTGYM_MJ_CLOTH_AIR_H_

#include <vector>

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/planes.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// Drag of the air on triangles that move along their normals, by their speed at the end of the step.
void AddDrag(const Mesh& mesh, const Start& start, double timestep, std::vector<double>* acceleration);

// A vertex of mass m that moves along its normal takes a mass a of air along, unless it touches something: of a push,
// the share a / (m + a) goes into the air. Contact has to bear all the weight.
// Fills `air` of `Points`; false, and nothing is done, if no flex takes any along.
bool StartAir(const Mesh& mesh, const Start& start, const std::vector<Pair>& pairs, const Planes& planes,
              AlignedFloats* air);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_AIR_H_
