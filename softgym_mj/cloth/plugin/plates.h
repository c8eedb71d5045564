// Bending of a sheet as an orthotropic plate with given stiffness along two directions and between them.
//
// Equal hinges at all inner edges model such a plate for long and shallow waves only: in a grid with alternating
// diagonals vertices of eight edges move relative to those of four, which reduces the stiffness by a quarter until
// edges would have to stretch. On a grid the rows are second differences along its lines at every vertex, and one per
// cell of its diagonals: for a smooth curvature k they store exactly
//   (Bx kxx^2 + By kyy^2 + 2 Bxy kxy^2) / 2
// per area without such relative motion. The stiffness at 45 degrees is (Bx + By + 2 Bxy) / 4. On any other mesh they
// are hinges of its inner edges (Bergou et al., 2006) with the plate's stiffness across the edge, all scaled such that
// the relaxed mesh has the plate's stiffness: in the mean over all directions, of wide sheets and narrow strips.

#ifndef SOFTGYM_MJ_CLOTH_PLATES_H_
#define SOFTGYM_MJ_CLOTH_PLATES_H_

#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

// Adds the hinges of a sheet with edges from `first_edge` on and triangles from `first_triangle` on.
void AddPlate(const Material& material, int first_edge, int first_triangle, Mesh* mesh);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PLATES_H_
