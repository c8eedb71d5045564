// Pressures of all particles and displacements by them on a CPU, with the bits of `FindPressureOf` and `AddCorrection`,
// under the restrictions of kernels.h. What follows from sums over pairs is computed for eight particles together.

#ifndef SOFTGYM_MJ_FLUID_PRESSURES_H_
#define SOFTGYM_MJ_FLUID_PRESSURES_H_

#include "fluid/plugin/particles.h"
#include "native/compression.h"

namespace softgym_mj {
namespace {

constexpr int kInOrder[kLanes] = {0, 1, 2, 3, 4, 5, 6, 7};

// Loads the vectors of four floats of eight consecutive particles.
inline Vec3<Lanes> LoadEight(const float* p, int i, Lanes* fourth) {
  Vec3<Lanes> out;
  Gather4(p + 4L * i, kInOrder, &out.x, &out.y, &out.z, fourth);
  return out;
}
inline void StoreEight(float* p, int i, const Vec3<Lanes>& a, Lanes fourth) {
  Scatter4(p + 4L * i, kInOrder, a.x, a.y, a.z, fourth);
}

// Writes e_ij of all pairs, their sums and those of their squares into `gradient`, and displacements by cohesion and
// kernel sums into `correction`.
template <bool kCohesive>
void SumPairs(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors) {
  const Lanes attraction(Attraction(fluid)), inverse_radius(1.0f / fluid.radius), zero(0.0f);
  float *ex = neighbors.e, *ey = ex + neighbors.stride, *ez = ey + neighbors.stride;
  for (int i = 0; i < p.count; ++i) {
    const float* xi = p.position + 4 * i;
    const Vec3<Lanes> x = {Lanes(xi[0]), Lanes(xi[1]), Lanes(xi[2])};
    PairSums all = {zero, zero, {zero, zero, zero}, {zero, zero, zero}};
    for (int k = neighbors.begin[i]; k < neighbors.end[i]; k += kLanes) {
      const Vec3<Lanes> e =
          AddPairs<kCohesive>(x, Gather(p.position, neighbors.index + k), inverse_radius, attraction, &all);
      e.x.Store(ex + k);
      e.y.Store(ey + k);
      e.z.Store(ez + k);
    }
    Sums(all.e.x, all.e.y, all.e.z, all.squares, p.gradient + 4 * i);
    Sums(all.pull.x, all.pull.y, all.pull.z, all.density, p.correction + 4 * i);
  }
}

void FindPressure(const FluidConstants& constants, const Particles& particles, const Neighbors& lists) {
  const FluidConstants fluid = constants;
  const Particles p = particles;
  const Neighbors neighbors = lists;
  if (fluid.cohesion > 0) {
    SumPairs<true>(fluid, p, neighbors);
  } else {
    SumPairs<false>(fluid, p, neighbors);
  }
  for (int i = 0; i < p.count; i += kLanes) {
    Lanes squares, density, rest;
    const Vec3<Lanes> own = LoadEight(p.gradient, i, &squares), wall = LoadEight(p.wall_gradient, i, &rest);
    const Vec3<Lanes> pull = LoadEight(p.correction, i, &density);
    const Vec3<Lanes> gradient = own + wall;
    const Lanes excess = Excess(fluid, density + Lanes::Load(p.wall_density + i));
    if (Bits(Less(Lanes(kCrowded), excess)) & FirstBits(p.count - i)) *p.crowded = true;
    PressureOf(excess, gradient, squares).Store(p.pressure + i);
    StoreEight(p.gradient, i, gradient, Lanes(0.0f));
    StoreEight(p.correction, i, pull, Lanes(0.0f));
  }
  p.pressure[p.count] = 0;
}

void AddCorrections(const FluidConstants& constants, const Particles& particles, const Neighbors& lists) {
  const FluidConstants fluid = constants;
  const Particles p = particles;
  const Neighbors neighbors = lists;
  const float *ex = neighbors.e, *ey = ex + neighbors.stride, *ez = ey + neighbors.stride;
  for (int i = 0; i < p.count; ++i) {
    Lanes x(0.0f), y(0.0f), z(0.0f);
    for (int k = neighbors.begin[i]; k < neighbors.end[i]; k += kLanes) {
      const Lanes pressure = Pick(p.pressure, neighbors.index + k);
      x = MultiplyAdd(pressure, Lanes::Load(ex + k), x);
      y = MultiplyAdd(pressure, Lanes::Load(ey + k), y);
      z = MultiplyAdd(pressure, Lanes::Load(ez + k), z);
    }
    const float* g = p.gradient + 4 * i;
    float sums[4];
    Sums(x, y, z, sums);
    const auto change = CorrectionOf<float>(fluid, {sums[0], sums[1], sums[2]}, p.pressure[i], {g[0], g[1], g[2]});
    float* correction = p.correction + 4 * i;
    correction[0] += change.x;
    correction[1] += change.y;
    correction[2] += change.z;
  }
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_PRESSURES_H_
