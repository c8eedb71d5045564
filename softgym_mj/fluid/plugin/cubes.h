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
  int corner;  // Where it begins.
};
CubeEdge EdgeOfCube(int edge);

// For each set of corners inside, as bits: triangles across edges, three each, anticlockwise seen from outside.
// Where a face has two opposite corners inside, they are held apart, in both cubes that have it: so the whole is
// closed, and each side of a triangle belongs to one other.
const std::array<std::vector<int>, 256>& CubeTriangles();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CUBES_H_
