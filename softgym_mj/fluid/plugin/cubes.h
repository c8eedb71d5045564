// The cases of marching cubes.

#ifndef SOFTGYM_MJ_FLUID_CUBES_H_
#define SOFTGYM_MJ_FLUID_CUBES_H_

#include <array>
#include <vector>

namespace softgym_mj {

// Corners of a cube are numbered by their coordinates, x + 2 y + 4 z. Edges along `axis` are 4 axis + b + 2 c, where
// b and c are their coordinates along the next axes, cyclically.
struct CubeEdge {
  int axis;
  int corner;  // First corner.
};
CubeEdge EdgeOfCube(int edge);

// Returns triangles for each set of inner corners (bits), as three edges each, counterclockwise seen from outside. Two
// opposite inner corners of a face are separated in both adjacent cubes, so that the surface is closed and each side
// of a triangle is shared with exactly one other.
const std::array<std::vector<int>, 256>& CubeTriangles();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CUBES_H_
