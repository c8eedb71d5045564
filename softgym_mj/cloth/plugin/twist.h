// Twist of ropes, shared by all solvers: discrete elastic rods with an isotropic cross-section and quasistatic material
// frames (Bergou et al., 2008). Twist waves are far faster than bending waves in thin rods, so that twist is uniform
// along the rope, and one angle per rope is the whole state. It is the roll of the last edge relative to the parallel
// transport of the first edge's frame. Edges turn without spin (time-parallel transport, Bergou et al., 2010): a motion
// changes the angle by the areas that pairs of tangents sweep on the unit sphere. The energy is that of the angle, with
// stiffness G J / l; its gradient is discrete, so that forces conserve momentum and, with the ends' moments, angular
// momentum. They are explicit: stable while the moment is below about (mass of a vertex) (edge length / substep)^2.

#ifndef SOFTGYM_MJ_CLOTH_TWIST_H_
#define SOFTGYM_MJ_CLOTH_TWIST_H_

#include <cmath>

#include "cloth/plugin/kernels.h"
#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

// Sharpest bend that the forces resolve, as 1 + cosine of the angle between two edges: 143 degrees. The curvature
// binormal is infinite at 180 degrees.
constexpr double kSharpest = 0.2;

// A rope of `size` edges: three numbers per edge and one per vertex. `vertex` has one more entry.
struct TwistRow {
  int size;
  bool is_ring;
  const int* vertex;
  double stiffness;       // Moment per angle [N m].
  double* angle;          // [rad]
  double *way, *next;     // Edges at the last update of the angle and now [m].
  double *change, *pull;  // Change of the angle at each vertex, and moment times its gradient by each edge.
};

// Angle of a vector (x, y) like std::atan2, which is not bit-identical on every processor.
inline double PolarAngle(double y, double x) {
  const double length = std::sqrt(x * x + y * y), sum = length + x;
  if (!(sum > 0)) return length > 0 ? 3.14159265358979323846 : 0;
  double t = y / sum;  // Tangent of half the angle, then of an eighth of that.
  for (int halving = 0; halving < 3; ++halving) t = t / (1 + std::sqrt(1 + t * t));
  const double square = t * t;
  double sum_of_series = 0;
  for (int k = 23; k >= 1; k -= 2) sum_of_series = 1.0 / k - square * sum_of_series;
  return 16 * (t * sum_of_series);
}

inline Vector Unit(const double* way) {
  const Vector a = FromArray(way);
  const double length = std::sqrt(Dot(a, a));
  return (1 / (length > 1e-12 ? length : 1e-12)) * a;
}

// Signed area of a triangle on the unit sphere (van Oosterom and Strackee, 1983).
inline double SphereArea(const Vector& a, const Vector& b, const Vector& c) {
  return 2 * PolarAngle(Dot(a, Cross(b, c)), 1 + Dot(a, b) + Dot(b, c) + Dot(c, a));
}

// Step 1: edges now, from positions at the start of the step and displacements.
inline void FollowTwistEdge(const double* start, const Points& points, const TwistRow& row, int e) {
  const int a = row.vertex[e], b = row.vertex[e + 1];
  for (int k = 0; k < 3; ++k) {
    row.next[3 * e + k] =
        (start[3 * b + k] - start[3 * a + k]) + (static_cast<double>(points.now[4 * b + k]) - points.now[4 * a + k]);
  }
}
// The same at the end of the step, from its motion.
inline void EndTwistEdge(const double* start, const double* motion, const TwistRow& row, int e) {
  const int a = row.vertex[e], b = row.vertex[e + 1];
  for (int k = 0; k < 3; ++k) {
    row.next[3 * e + k] = (start[3 * b + k] - start[3 * a + k]) + (motion[3 * b + k] - motion[3 * a + k]);
  }
}
inline void StartTwistEdge(const double* start, const TwistRow& row, int e) {
  const int a = row.vertex[e], b = row.vertex[e + 1];
  for (int k = 0; k < 3; ++k) row.way[3 * e + k] = start[3 * b + k] - start[3 * a + k];
}

// Edge before vertex `i` of the row, or -1 if none or no edge follows: the ends of a rope do not bend.
inline int EdgeBefore(const TwistRow& row, int i) {
  if (i > 0) return i < row.size ? i - 1 : -1;
  return row.is_ring ? row.size - 1 : -1;
}

// Step 2: change of the angle at vertex `i` < size.
inline void TurnTwistVertex(const TwistRow& row, int i) {
  const int e = EdgeBefore(row, i);
  row.change[i] = 0;
  if (e < 0) return;
  const Vector a = Unit(row.way + 3 * e), b = Unit(row.way + 3 * i);
  const Vector c = Unit(row.next + 3 * i), d = Unit(row.next + 3 * e);
  row.change[i] = SphereArea(a, b, c) + SphereArea(a, c, d);
}

// Step 3: the angle; edges now become the last ones afterwards.
inline void AddTwist(const TwistRow& row) {
  for (int i = 0; i < row.size; ++i) *row.angle += row.change[i];
}

// Curvature binormal at vertex `i`, 0 at the ends of a rope.
inline Vector Binormal(const TwistRow& row, int i) {
  const int e = EdgeBefore(row, i);
  if (e < 0) return {0, 0, 0};
  const Vector a = Unit(row.next + 3 * e), b = Unit(row.next + 3 * i);
  const double denominator = 1 + Dot(a, b);
  return (2 / (denominator > kSharpest ? denominator : kSharpest)) * Cross(a, b);
}

// Step 4: moment times the gradient of the angle by edge `e`; the edge becomes the last one.
inline void PullTwistEdge(const TwistRow& row, int e) {
  const int after = e + 1 < row.size ? e + 1 : row.is_ring ? 0 : row.size;
  const Vector sum = Binormal(row, e) + Binormal(row, after);
  const Vector way = FromArray(row.next + 3 * e);
  const double length = std::sqrt(Dot(way, way));
  const double scale = row.stiffness * *row.angle / (2 * (length > 1e-12 ? length : 1e-12));
  row.pull[3 * e] = scale * sum.x, row.pull[3 * e + 1] = scale * sum.y, row.pull[3 * e + 2] = scale * sum.z;
}
inline void KeepTwistEdge(const TwistRow& row, int e) {
  for (int k = 0; k < 3; ++k) row.way[3 * e + k] = row.next[3 * e + k];
}

// Number of different vertices of the row.
inline int TwistVertices(const TwistRow& row) { return row.is_ring ? row.size : row.size + 1; }

// Step 5: impulse of the forces on vertex `i` in a substep of `h` [s]. It changes the point's last displacement, before
// the substep moves the point, so that forces act at the positions they are computed from.
inline void PushTwistVertex(const Points& points, const TwistRow& row, int i, double h) {
  const int before = i > 0 ? i - 1 : row.is_ring ? row.size - 1 : -1;
  const int v = row.vertex[i];
  const double share = h * h * points.now[4 * v + 3];
  for (int k = 0; k < 3; ++k) {
    const double follows = i < row.size ? row.pull[3 * i + k] : 0, leads = before >= 0 ? row.pull[3 * before + k] : 0;
    points.before[4 * v + k] = static_cast<float>(points.before[4 * v + k] - share * (follows - leads));
  }
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_TWIST_H_
