// Computations for one particle, or for eight near a wall, under the restrictions of kernels.h.
//
// Position-based fluid (Macklin and Mueller, 2013) with the kernel w(r) = (1 - r/H)^3 for both
// density and gradient, the particle itself excluded, and constraints that only push. With
// e_ij = (1 - r/H)^2 (x_i - x_j) / r the gradient is -3 e_ij / H, and a correction is
//   dx_i = relaxation rho0 H/3 (p_i E_i + sum_j p_j e_ij),   E_i = sum_j e_ij,
//   p_i = max(rho_i / rho0 - 1, 0) / (|E_i|^2 + sum_j |e_ij|^2).
// Pairs push each other equally, so momentum is conserved.

#ifndef SOFTGYM_MJ_FLUID_PARTICLES_H_
#define SOFTGYM_MJ_FLUID_PARTICLES_H_

#include "fluid/plugin/kernels.h"
#include "native/divide.h"
#include "native/shapes.h"

namespace softgym_mj {
namespace {

// If a wall would have to move a particle by more than its contact distance, it was placed onto it; the particle then
// recovers by at most this share of the spacing per substep.
constexpr float kDigOut = 0.1f;
// Share of its distance by which a particle may approach a wall in a substep. Below one, no particle passes through a
// wall, however thin.
constexpr float kApproach = 0.9f;
// Smallest excess density of a particle that coincides with another one; water at rest has 0.01.
constexpr float kCrowded = 0.5f;

// The vectors of four floats at `index`, without the fourth.
template <class Index>
inline Vec3<Lanes> Gather(const float* p, const Index* index) {
  Vec3<Lanes> out;
  Lanes rest;
  Gather4(p, index, &out.x, &out.y, &out.z, &rest);
  return out;
}

// Adds to the vectors of four floats at `index` that are below `count`.
inline void Add(float* p, const int* index, int count, const Vec3<Lanes>& a) {
  float x[kLanes], y[kLanes], z[kLanes];
  a.x.Store(x);
  a.y.Store(y);
  a.z.Store(z);
  EachLane([&](int lane) {
    if (index[lane] >= count) return;
    float* q = p + 4 * index[lane];
    q[0] += x[lane];
    q[1] += y[lane];
    q[2] += z[lane];
  });
}

// Interaction of a particle with others: parts of the kernel, and e_ij.
struct Nearness {
  Lanes q, s, s2;
  Vec3<Lanes> away, e;
};
inline Nearness FindNearness(const Vec3<Lanes>& x, const Vec3<Lanes>& other, Lanes inverse_radius) {
  const Lanes one(1.0f), zero(0.0f), tiny(kTiny);
  Nearness near;
  near.away = {x.x - other.x, x.y - other.y, x.z - other.z};
  const Vec3<Lanes>& d = near.away;
  const Lanes r = SqrtOfModerate(Max(MultiplyAdd(d.x, d.x, MultiplyAdd(d.y, d.y, d.z * d.z)), tiny));
  near.q = r * inverse_radius;
  near.s = Max(one - near.q, zero);
  near.s2 = near.s * near.s;
  const Lanes scale = DivideModerate(near.s2, r);
  near.e = {scale * d.x, scale * d.y, scale * d.z};
  return near;
}

// Sums over the neighbors of a particle, lane by lane.
struct PairSums {
  Lanes density, squares;
  Vec3<Lanes> e, pull;
};

// Adds eight neighbors to the sums; returns e_ij. Cohesion attracts by 27/4 q^2 (1 - q), at most 1, largest at
// q = r/H = 2/3.
template <bool kCohesive>
inline Vec3<Lanes> AddPairs(const Vec3<Lanes>& x, const Vec3<Lanes>& other, Lanes inverse_radius, Lanes attraction,
                            PairSums* sums) {
  const Nearness near = FindNearness(x, other, inverse_radius);
  sums->density = MultiplyAdd(near.s2, near.s, sums->density);
  sums->squares = MultiplyAdd(near.s2, near.s2, sums->squares);
  sums->e = sums->e + near.e;
  if (kCohesive) {
    const Lanes pull = attraction * near.q * near.s;
    sums->pull = {MultiplyAdd(pull, near.away.x, sums->pull.x), MultiplyAdd(pull, near.away.y, sums->pull.y),
                  MultiplyAdd(pull, near.away.z, sums->pull.z)};
  }
  return near.e;
}

inline float Attraction(const FluidConstants& fluid) { return -6.75f * fluid.cohesion / fluid.radius; }

// Share by which particles, one or eight, are denser than water at rest; `density`: kernel sum with that of walls.
template <class T>
inline T Excess(const FluidConstants& fluid, T density) {
  return density / T(fluid.rest_density) - T(1.0f);
}

// Pressure of particles, one or eight, given the gradient with the walls' part and the sum of |e_ij|^2.
template <class T>
inline T PressureOf(T excess, const Vec3<T>& gradient, T squares) {
  const T length = gradient.x * gradient.x + gradient.y * gradient.y + gradient.z * gradient.z + squares;
  return DivideOften0(Max(excess, T(0.0f)), length + T(1e-6f));
}

// Factor by which displacements are at most `limit`, given their squared lengths.
inline float Shortening(float squared, float limit) { return squared > limit * limit ? limit / sqrtf(squared) : 1.0f; }
inline Lanes Shortening(Lanes squared, Lanes limit) {
  return Select(Less(limit * limit, squared), limit / Sqrt(squared), Lanes(1.0f));
}

// Displacement by pressure of particles, one or eight, given sum_j p_j e_ij; at most the largest correction.
template <class T>
inline Vec3<T> CorrectionOf(const FluidConstants& fluid, const Vec3<T>& sum, T pressure, const Vec3<T>& gradient) {
  const T scale(fluid.relaxation * fluid.rest_density * fluid.radius / 3.0f), limit(fluid.correction);
  const T dx = scale * (sum.x + pressure * gradient.x);
  const T dy = scale * (sum.y + pressure * gradient.y);
  const T dz = scale * (sum.z + pressure * gradient.z);
  const T squared = dx * dx + dy * dy + dz * dz;
  const T clamp = Shortening(squared, limit);
  return {clamp * dx, clamp * dy, clamp * dz};
}

template <bool kCohesive>
inline void FindPressureOf(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors, int i) {
  const Lanes attraction(Attraction(fluid)), inverse_radius(1.0f / fluid.radius), zero(0.0f);
  const float* xi = p.position + 4 * i;
  const Vec3<Lanes> x = {Lanes(xi[0]), Lanes(xi[1]), Lanes(xi[2])};
  PairSums all = {zero, zero, {zero, zero, zero}, {zero, zero, zero}};
  for (int k = neighbors.begin[i]; k < neighbors.end[i]; k += kLanes) {
    AddPairs<kCohesive>(x, Gather(p.position, neighbors.index + k), inverse_radius, attraction, &all);
  }
  float pull[4], sums[4];
  Sums(all.pull.x, all.pull.y, all.pull.z, all.density, pull);
  Sums(all.e.x, all.e.y, all.e.z, all.squares, sums);
  const float* wall = p.wall_gradient + 4 * i;
  const Vec3<float> gradient = {sums[0] + wall[0], sums[1] + wall[1], sums[2] + wall[2]};
  const float excess = Excess(fluid, pull[3] + p.wall_density[i]);
  OneLane([&] {
    if (excess > kCrowded) *p.crowded = true;
    const float pressure = PressureOf(excess, gradient, sums[3]);
    p.pressure[i] = pressure;
    Store4(p.packed + 4 * i, xi[0], xi[1], xi[2], pressure);
    Store4(p.correction + 4 * i, pull[0], pull[1], pull[2], 0);
    Store4(p.gradient + 4 * i, gradient.x, gradient.y, gradient.z, 0);
  });
}

inline void AddCorrection(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors, int i) {
  const Lanes inverse_radius(1.0f / fluid.radius);
  const float* xi = p.position + 4 * i;
  const Vec3<Lanes> from = {Lanes(xi[0]), Lanes(xi[1]), Lanes(xi[2])};
  Lanes x(0.0f), y(0.0f), z(0.0f);
  for (int k = neighbors.begin[i]; k < neighbors.end[i]; k += kLanes) {
    Lanes pressure;
    Vec3<Lanes> other;
    Gather4(p.packed, neighbors.index + k, &other.x, &other.y, &other.z, &pressure);
    const Vec3<Lanes> e = FindNearness(from, other, inverse_radius).e;
    x = MultiplyAdd(pressure, e.x, x);
    y = MultiplyAdd(pressure, e.y, y);
    z = MultiplyAdd(pressure, e.z, z);
  }
  const float* g = p.gradient + 4 * i;
  float sums[4];
  Sums(x, y, z, sums);
  const auto change = CorrectionOf<float>(fluid, {sums[0], sums[1], sums[2]}, p.pressure[i], {g[0], g[1], g[2]});
  OneLane([&] {
    float* correction = p.correction + 4 * i;
    correction[0] += change.x;
    correction[1] += change.y;
    correction[2] += change.z;
  });
}

inline void Smooth(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors, float viscosity,
                   int i) {
  const Lanes one(1.0f), zero(0.0f), inverse_radius(1.0f / fluid.radius), tiny(kTiny);
  const float *xi = p.position + 4 * i, *vi = p.velocity + 4 * i;
  const Lanes x(xi[0]), y(xi[1]), z(xi[2]), u(vi[0]), v(vi[1]), w(vi[2]);
  Lanes sum_u(0.0f), sum_v(0.0f), sum_w(0.0f);
  for (int k = neighbors.begin[i]; k < neighbors.end[i]; k += kLanes) {
    const Vec3<Lanes> xj = Gather(p.position, neighbors.index + k);
    const Vec3<Lanes> vj = Gather(p.velocity, neighbors.index + k);
    const Lanes dx = x - xj.x, dy = y - xj.y, dz = z - xj.z;
    const Lanes squared = Max(MultiplyAdd(dx, dx, MultiplyAdd(dy, dy, dz * dz)), tiny);
    const Lanes s = Max(one - SqrtOfModerate(squared) * inverse_radius, zero);
    const Lanes weight = s * s * s;
    sum_u = MultiplyAdd(weight, vj.x - u, sum_u);
    sum_v = MultiplyAdd(weight, vj.y - v, sum_v);
    sum_w = MultiplyAdd(weight, vj.z - w, sum_w);
  }
  float sums[4];
  Sums(sum_u, sum_v, sum_w, sums);
  OneLane([&] {
    for (int k = 0; k < 3; ++k) p.correction[4 * i + k] = viscosity * sums[k];
  });
}

inline void FindDistance(const WallPairs& pairs, const float* position, float* distance, int k) {
  Vec3<Lanes> normal;
  const Vec3<Lanes> local = ToLocal(pairs.end, Gather(position, pairs.particle + k));
  Distance<Lanes>(pairs.shape, pairs.size, local, &normal).Store(distance + k);
}

// The half space behind the tangent plane at distance d counts as filled with water at rest. With
// u = 1 - d/H the integral of the kernel over it is proportional to u^5 (1/20 - u/30).
inline void FindWallShare(const FluidConstants& fluid, const Particles& p, const WallPairs& pairs, int k) {
  const Lanes zero(0.0f), one(1.0f), inverse_radius(1.0f / fluid.radius);
  const Lanes scale(fluid.wall_density / fluid.rest_density);
  const Lanes slope_scale(fluid.wall_density / 3.0f);
  const Vec3<Lanes> x = Gather(p.position, pairs.particle + k);
  Vec3<Lanes> local_normal;
  const Lanes d = Distance<Lanes>(pairs.shape, pairs.size, ToLocal(pairs.end, x), &local_normal);
  const Vec3<Lanes> normal = Rotate(pairs.end, local_normal);
  const Lanes u = Min(Max(one - d * inverse_radius, zero), one);
  const Lanes u4 = Square(u * u);
  const Lanes share = scale * u4 * u * (Lanes(1.0f / 20.0f) - u * Lanes(1.0f / 30.0f));
  const Lanes slope = slope_scale * u4 * (Lanes(0.25f) - u * Lanes(0.2f));
  normal.x.Store(pairs.normal + k);
  normal.y.Store(pairs.normal + pairs.stride + k);
  normal.z.Store(pairs.normal + 2 * pairs.stride + k);
  share.Store(pairs.share + k);
  slope.Store(pairs.slope + k);
  EachLane([&](int lane) {
    const int i = pairs.particle[k + lane];
    if (i < p.count) p.free_share[i] *= 1.0f - pairs.share[k + lane];
  });
}

// Several walls together fill 1 - prod(1 - share), exact where they are orthogonal.
inline void AddWallGradient(const Particles& p, const WallPairs& pairs, int k) {
  const float *nx = pairs.normal, *ny = nx + pairs.stride, *nz = ny + pairs.stride;
  const int i = pairs.particle[k];
  if (i == p.count) return;  // Padding.
  pairs.slope[k] *= p.free_share[i] / (1.0f - pairs.share[k]);
  float* gradient = p.wall_gradient + 4 * i;
  gradient[0] += pairs.slope[k] * nx[k];
  gradient[1] += pairs.slope[k] * ny[k];
  gradient[2] += pairs.slope[k] * nz[k];
}

// Keeps eight particles out of a wall. Calls note(change, to, push): their displacements, where they end, and the
// displacements along the normals by the pressure at the wall.
template <class Note>
inline void Collide(const FluidConstants& fluid, const Particles& p, const WallPairs& pairs, int k, Note note) {
  const Lanes zero(0.0f), contact(fluid.contact), tiny(kTiny), friction(fluid.friction);
  const Lanes dig_out(kDigOut * fluid.spacing);
  const Lanes wall_push(fluid.relaxation * fluid.rest_density * fluid.radius / 3.0f);
  const int* particle = pairs.particle + k;
  const Vec3<Lanes> old_x = Gather(p.old_position, particle);
  const Vec3<Lanes> predicted = Gather(p.position, particle);
  const Vec3<Lanes> correction = Gather(p.correction, particle);
  const Vec3<Lanes> x = {predicted.x + correction.x, predicted.y + correction.y, predicted.z + correction.z};
  const Vec3<Lanes> from = ToLocal(pairs.start, old_x), to = ToLocal(pairs.end, x);
  Vec3<Lanes> normal;
  const Lanes old_distance = Distance<Lanes>(pairs.shape, pairs.size, from, &normal);
  // Displacement relative to the wall, shortened so that it cannot pass through it.
  Vec3<Lanes> way = {to.x - from.x, to.y - from.y, to.z - from.z};
  const Lanes length = Dot(way, way);
  const Lanes limit = Select(Less(zero, old_distance), Lanes(kApproach) * old_distance, contact);
  const Lanes shorten = Min(limit / Sqrt(Max(length, tiny)), Lanes(1.0f));
  way = {way.x * shorten, way.y * shorten, way.z * shorten};
  const Vec3<Lanes> reached = {from.x + way.x, from.y + way.y, from.z + way.z};
  const Lanes distance = Distance<Lanes>(pairs.shape, pairs.size, reached, &normal);
  const Lanes push = Min(Max(contact - distance, zero), Select(Less(zero, distance), contact, dig_out));
  // Coulomb friction against the push of the contact and of the pressure.
  const Lanes pressure_push = wall_push * Pick(p.pressure, particle) * Lanes::Load(pairs.slope + k);
  const Lanes along = Dot(way, normal);
  const Vec3<Lanes> slide = {way.x - along * normal.x, way.y - along * normal.y, way.z - along * normal.z};
  const Lanes grip =
      Min(DivideOften0(friction * (push + pressure_push), Sqrt(Max(Dot(slide, slide), tiny))), Lanes(1.0f));
  const Vec3<Lanes> local = {reached.x + push * normal.x - grip * slide.x, reached.y + push * normal.y - grip * slide.y,
                             reached.z + push * normal.z - grip * slide.z};
  Vec3<Lanes> change = Rotate<Lanes>(pairs.end, {local.x - to.x, local.y - to.y, local.z - to.z});
  Add(p.correction, particle, p.count, change);
  note(change, {x.x + change.x, x.y + change.y, x.z + change.z}, pressure_push);
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_PARTICLES_H_
