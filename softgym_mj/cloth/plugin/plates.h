// Bending of a sheet as of a plate whose stiffness along two directions and between them is given.
//
// The hinges of all inner edges, alike, are such a plate for long and shallow waves only: in a grid with alternating
// diagonals they hold vertices of four edges and not those of eight, which give way by a quarter until bends are so
// strong that edges would have to stretch for it. On a grid these rows are second differences along its lines at every
// vertex, and one of each cell's diagonals: of a smooth bend k they store exactly
//   (Bx kxx^2 + By kyy^2 + 2 Bxy kxy^2) / 2
// per area, and no vertex has to give way for it. The stiffness at 45 degrees is (Bx + By + 2 Bxy) / 4. On any other
// mesh they are hinges of its inner edges (Bergou et al., 2006), as stiff as the plate is across them, all scaled such
// that the mesh resists as the plate would: in the mean over all directions and of wide sheets and narrow strips, once
// vertices have given way.

#ifndef SOFTGYM_MJ_CLOTH_PLATES_H_
#define SOFTGYM_MJ_CLOTH_PLATES_H_

#include "cloth/plugin/mesh.h"

namespace softgym_mj::cloth {

// Adds the hinges of a sheet: of the edges from `first_edge` on, triangles from `first_triangle` on.
void AddPlate(const Material& material, int first_edge, int first_triangle, Mesh* mesh);

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_PLATES_H_
