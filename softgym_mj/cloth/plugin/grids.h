// Distances to meshes and heightfields, under the restrictions of native/simd.h.

#ifndef SOFTGYM_MJ_CLOTH_GRIDS_H_
#define SOFTGYM_MJ_CLOTH_GRIDS_H_

#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/search.h"
#include "cloth/plugin/sweeps.h"
#include "native/shapes.h"
#include "native/simd.h"

namespace softgym_mj::cloth {
namespace {

constexpr int kAround[] = {0, 1, 3, 4, 6, 7};  // Of the eight triangles of four cells those that contain the middle.
constexpr float kTie = 1e-5f;        // [m] Corners of a triangle this equally near to a plane surface count as equal.
constexpr float kOnSurface = 1e-5f;  // [m] Nearer points use the normal of the triangle below.

inline bool HasGrid(const Geom& geom) {
  return kGrids && (geom.shape == Shape::kMesh || geom.shape == Shape::kHeights);
}

inline float Last(const Grid& grid, int axis) { return grid.low[axis] + grid.step[axis] * (grid.count[axis] - 1); }

// Cell that contains a coordinate in units of the step, which is not negative.
inline int CellOf(float place, int count) {
  const int cell = static_cast<int>(place);
  return cell < count - 2 ? cell : count - 2;
}

// Signed distance and outward normal of a mesh: trilinear in its grid, and beyond it from the nearest point in it.
inline Lanes MeshDistance(const Grid& grid, const Lanes3& p, Lanes3* normal) {
  const Lanes* coordinate[3] = {&p.x, &p.y, &p.z};
  const Lanes zero(0.0f), one(1.0f);
  Lanes share[3], beyond[3];
  alignas(32) float place[3][kLanes], whole[3][kLanes];
  int node[kLanes];
  for (int k = 0; k < 3; ++k) {
    const Lanes inside = Clamp(*coordinate[k], grid.low[k], Last(grid, k));
    beyond[k] = *coordinate[k] - inside;
    ((inside - Lanes(grid.low[k])) / Lanes(grid.step[k])).Store(place[k]);
  }
  EachLane([&](int lane) {
    int cell[3];
    for (int k = 0; k < 3; ++k) {
      cell[k] = CellOf(place[k][lane], grid.count[k]);
      whole[k][lane] = static_cast<float>(cell[k]);
    }
    node[lane] = (cell[2] * grid.count[1] + cell[1]) * grid.count[0] + cell[0];
  });
  for (int k = 0; k < 3; ++k) share[k] = Lanes::Load(place[k]) - Lanes::Load(whole[k]);
  Lanes3 gradient = {zero, zero, zero};
  Lanes distance = zero;
  for (int corner = 0; corner < 8; ++corner) {
    const int x = corner % 2, y = corner / 2 % 2, z = corner / 4;
    const Lanes weight =
        (x ? share[0] : one - share[0]) * (y ? share[1] : one - share[1]) * (z ? share[2] : one - share[2]);
    Lanes there;
    const float* nodes = grid.nodes + 4L * ((z * grid.count[1] + y) * grid.count[0] + x);
    const Lanes3 direction = Gather(nodes, node, &there);
    gradient = AddScaled(gradient, weight, direction);
    distance = MultiplyAdd(weight, there, distance);
  }
  const Lanes inverse = one / Sqrt(Max(Inner(gradient, gradient), Lanes(kTiny)));
  const Lanes3 along = inverse * gradient, outside = {beyond[0], beyond[1], beyond[2]};
  const Lanes3 way = AddScaled(outside, distance, along);
  const Mask is_outside = Less(zero, Inner(outside, outside));
  const Lanes length = Sqrt(Max(Inner(way, way), Lanes(kTiny))), inverse_length = one / length;
  normal->x = Select(is_outside, way.x * inverse_length, along.x);
  normal->y = Select(is_outside, way.y * inverse_length, along.y);
  normal->z = Select(is_outside, way.z * inverse_length, along.z);
  return Select(is_outside, length, distance);
}

// Signed distance to the surface of a heightfield above or below a point inside its borders: that to the nearest of the
// triangles around the nearest node. Diagonals of cells go from the least to the largest x and y.
inline Lanes SurfaceDistance(const Grid& grid, const Lanes3& p, Lanes3* normal) {
  const Lanes zero(0.0f), one(1.0f), dx(grid.step[0]), dy(grid.step[1]);
  alignas(32) float u[kLanes], v[kLanes], share_x[kLanes], share_y[kLanes];
  alignas(32) float x[3][kLanes], y[3][kLanes], height[3][3][kLanes], own[2][2][kLanes];  // Rows along y.
  ((p.x - Lanes(grid.low[0])) / dx).Store(u);
  ((p.y - Lanes(grid.low[1])) / dy).Store(v);
  EachLane([&](int lane) {
    const int columns = grid.count[0], rows = grid.count[1];
    const auto at = [&](int row, int column) { return grid.step[2] * grid.nodes[row * columns + column]; };
    const auto within = [](int i, int count) { return i < 0 ? 0 : i < count ? i : count - 1; };
    const int column = CellOf(u[lane], columns), row = CellOf(v[lane], rows);
    share_x[lane] = u[lane] - static_cast<float>(column);
    share_y[lane] = v[lane] - static_cast<float>(row);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) own[i][j][lane] = at(row + i, column + j);
    }
    const int middle_column = static_cast<int>(u[lane] + 0.5f), middle_row = static_cast<int>(v[lane] + 0.5f);
    for (int i = 0; i < 3; ++i) {
      const int of_row = within(middle_row + i - 1, rows), of_column = within(middle_column + i - 1, columns);
      x[i][lane] = grid.low[0] + grid.step[0] * static_cast<float>(of_column);
      y[i][lane] = grid.low[1] + grid.step[1] * static_cast<float>(of_row);
      for (int j = 0; j < 3; ++j) height[i][j][lane] = at(of_row, within(middle_column + j - 1, columns));
    }
  });
  Lanes least(1e30f);
  Lanes3 away = {zero, zero, zero};
  const auto corner = [&](int row, int column) {
    return Lanes3{Lanes::Load(x[column]), Lanes::Load(y[row]), Lanes::Load(height[row][column])};
  };
  for (const int triangle : kAround) {
    const int row = triangle / 4, column = triangle / 2 % 2, upper = triangle % 2;
    const Lanes3 a = corner(row, column), b = corner(row + 1, column + 1), c = corner(row + upper, column + 1 - upper);
    Lanes weight[3];
    ClosestOnTriangle(p, a, b, c, weight);
    const Lanes3 off = p - AddScaled(AddScaled(weight[0] * a, weight[1], b), weight[2], c);
    const Lanes square = Inner(off, off);
    const Mask nearer = Less(square, least);
    least = Select(nearer, square, least);
    away = {Select(nearer, off.x, away.x), Select(nearer, off.y, away.y), Select(nearer, off.z, away.z)};
  }
  // The plane of the triangle below the point.
  const Lanes s = Lanes::Load(share_x), t = Lanes::Load(share_y);
  const Lanes low = Lanes::Load(own[0][0]), high = Lanes::Load(own[1][1]);
  const Mask lower = Less(t, s);
  const Lanes side = Select(lower, Lanes::Load(own[0][1]), Lanes::Load(own[1][0]));
  const Lanes slope_x = Select(lower, side - low, high - side), slope_y = Select(lower, high - side, side - low);
  const Mask below = Less(p.z, low + MultiplyAdd(s, slope_x, t * slope_y));
  const Lanes3 up = {-(slope_x / dx), -(slope_y / dy), one};
  const Lanes inverse_up = one / Sqrt(Inner(up, up));
  const Lanes length = Sqrt(least), distance = Select(below, -length, length);
  const Mask on = Less(length, Lanes(kOnSurface));
  const Lanes inverse = one / Select(on, one, distance);
  normal->x = Select(on, up.x * inverse_up, away.x * inverse);
  normal->y = Select(on, up.y * inverse_up, away.y * inverse);
  normal->z = Select(on, inverse_up, away.z * inverse);
  return distance;
}

// Signed distance and outward normal of a heightfield, the part of a box below its surface. Beyond its borders the
// distance is a lower bound.
inline Lanes HeightsDistance(const Grid& grid, const Lanes3& p, Lanes3* normal) {
  const Lanes zero(0.0f), one(1.0f);
  const Lanes3 within = {Clamp(p.x, grid.low[0], Last(grid, 0)), Clamp(p.y, grid.low[1], Last(grid, 1)), p.z};
  Lanes distance = SurfaceDistance(grid, within, normal);
  const auto cut = [&](Lanes beyond, const Lanes3& outwards) {
    const Mask further = Less(distance, beyond);
    distance = Select(further, beyond, distance);
    normal->x = Select(further, outwards.x, normal->x);
    normal->y = Select(further, outwards.y, normal->y);
    normal->z = Select(further, outwards.z, normal->z);
  };
  cut(Abs(p.x) + Lanes(grid.low[0]), {CopySign(one, p.x), zero, zero});
  cut(Abs(p.y) + Lanes(grid.low[1]), {zero, CopySign(one, p.y), zero});
  cut(Lanes(grid.low[2]) - p.z, {zero, zero, -one});
  return distance;
}

// Signed distance and outward normal of a geom in its frame.
inline Lanes GeomDistance(const Geom& geom, const Lanes3& p, Lanes3* normal) {
  if (kGrids && geom.shape == Shape::kMesh) return MeshDistance(geom.grid, p, normal);
  if (kGrids && geom.shape == Shape::kHeights) return HeightsDistance(geom.grid, p, normal);
  return Distance<Lanes>(geom.shape, geom.size, p, normal);
}

// Whether a point may be nearer than `reach` [m] to a mesh or heightfield.
inline bool GridComesNear(const Geom& geom, const Vec3<float>& p, float reach) {
  const Grid& grid = geom.grid;
  const float coordinate[3] = {p.x, p.y, p.z};
  const bool is_mesh = geom.shape == Shape::kMesh;
  float beyond = 0;
  int node[3] = {0, 0, 0}, span[3] = {0, 0, 0};
  for (int k = 0; k < 2 + is_mesh; ++k) {
    const float inside = Clamp(coordinate[k], grid.low[k], Last(grid, k));
    beyond = MultiplyAdd(coordinate[k] - inside, coordinate[k] - inside, beyond);
    node[k] = static_cast<int>((inside - grid.low[k]) / grid.step[k] + 0.5f);
    const float cells = reach / grid.step[k] + 1;
    span[k] = cells < static_cast<float>(grid.count[k]) ? static_cast<int>(cells) : grid.count[k];
  }
  if (beyond > reach * reach) return false;
  if (is_mesh) {
    // A distance changes by no more than the way to the node, less than a step.
    const int at = (node[2] * grid.count[1] + node[1]) * grid.count[0] + node[0];
    return beyond > 0 || grid.nodes[4L * at + 3] - grid.step[0] < reach;
  }
  if (p.z < grid.low[2] - reach) return false;
  for (int row = node[1] - span[1]; row <= node[1] + span[1]; ++row) {
    for (int column = node[0] - span[0]; column <= node[0] + span[0]; ++column) {
      if (row < 0 || row >= grid.count[1] || column < 0 || column >= grid.count[0]) continue;
      if (p.z - reach < grid.step[2] * grid.nodes[row * grid.count[0] + column]) return true;
    }
  }
  return false;
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_GRIDS_H_
