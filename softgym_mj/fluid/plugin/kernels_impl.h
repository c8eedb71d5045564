// The kernels, for any vector type V with V::kWidth lanes. See kernels.h for what they must not use.
//
// Position-based fluid (Macklin and Mueller, 2013) with the kernel w(r) = (1 - r/H)^3 for both
// density and gradient, the particle itself excluded, and constraints that only push. With
// e_ij = (1 - r/H)^2 (x_i - x_j) / r the gradient is -3 e_ij / H, and a correction is
//   dx_i = relaxation rho0 H/3 (p_i E_i + sum_j p_j e_ij),   E_i = sum_j e_ij,
//   p_i = max(rho_i / rho0 - 1, 0) / (|E_i|^2 + sum_j |e_ij|^2).
// Pairs push each other equally, so momentum is conserved.

#ifndef SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
#define SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_

#include <math.h>

#include "kernels.h"
#include "shapes.h"

namespace softgym_mj {
namespace {

// A wall that would have to move a particle by more than its contact distance was put onto it;
// it pushes it out by at most this share of the spacing in a substep.
constexpr float kDigOut = 0.1f;
// A particle may come closer to a wall in a substep by this share of its distance. Since this is
// below one nothing passes through a wall, however thin.
constexpr float kApproach = 0.9f;
// A particle in the place of another one has at least this excess of density; water at rest has a
// hundredth.
constexpr float kCrowded = 0.5f;

template <class V>
bool FindNeighbors(const Particles& particles, const Grid& grid, float distance,
                    const Neighbors& out) {
  constexpr int kWidth = V::kWidth;
  const float *px = particles.x, *py = particles.y, *pz = particles.z;
  const int* start = grid.start;
  const int nx = grid.nx, ny = grid.ny, nz = grid.nz, dummy = particles.count;
  const V limit(distance * distance);
  int* index = out.index;
  int length = 0;
  for (int cz = 0; cz < nz; ++cz) {
    for (int cy = 0; cy < ny; ++cy) {
      for (int cx = 0; cx < nx; ++cx) {
        const int cell = cx + nx * (cy + ny * cz);
        if (start[cell] == start[cell + 1]) continue;
        // The cells around it are 9 rows, each one range of particles or, where it wraps, two.
        int first[18], last[18], ranges = 0;
        for (int dz = -1; dz <= 1; ++dz) {
          for (int dy = -1; dy <= 1; ++dy) {
            const int row = nx * (((cy + dy) & (ny - 1)) + ny * ((cz + dz) & (nz - 1)));
            if (cx > 0 && cx < nx - 1) {
              first[ranges] = start[row + cx - 1];
              last[ranges++] = start[row + cx + 2];
            } else {
              const int left = cx > 0 ? cx - 1 : 0, right = cx > 0 ? nx : 2;
              first[ranges] = start[row + left];
              last[ranges++] = start[row + right];
              const int other = cx > 0 ? 0 : nx - 1;
              first[ranges] = start[row + other];
              last[ranges++] = start[row + other + 1];
            }
          }
        }
        long candidates = 2 * kMaxWidth;
        for (int r = 0; r < ranges; ++r) candidates += last[r] - first[r];
        if (length + candidates * (start[cell + 1] - start[cell]) > out.capacity) return false;
        for (int i = start[cell]; i < start[cell + 1]; ++i) {
          out.begin[i] = length;
          const V x(px[i]), y(py[i]), z(pz[i]);
          for (int r = 0; r < ranges; ++r) {
            for (int k = first[r]; k < last[r]; k += kWidth) {
              const V dx = V::Load(px + k) - x, dy = V::Load(py + k) - y, dz = V::Load(pz + k) - z;
              const V squared = MultiplyAdd(dx, dx, MultiplyAdd(dy, dy, dz * dz));
              unsigned hits = Bits(Less(squared, limit));
              if (last[r] - k < kWidth) hits &= (1u << (last[r] - k)) - 1u;
              const unsigned self = static_cast<unsigned>(i - k);
              if (self < static_cast<unsigned>(kWidth)) hits &= ~(1u << self);
              length += V::Compress(k, hits, index + length);
            }
          }
          while ((length - out.begin[i]) % kWidth) index[length++] = dummy;
        }
      }
    }
  }
  out.begin[particles.count] = length;
  return true;
}

// Cohesion attracts by 27/4 q^2 (1 - q), at most 1, largest at q = r/H = 2/3.
template <class V, bool kCohesive>
void FindPressureOf(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors) {
  const V attraction(-6.75f * fluid.cohesion);
  const V one(1.0f), zero(0.0f), inverse_radius(1.0f / fluid.radius), tiny(kTiny);
  float *ex = neighbors.e, *ey = ex + neighbors.stride, *ez = ey + neighbors.stride;
  for (int i = 0; i < p.count; ++i) {
    const float* xi = p.position + 4 * i;
    const V x(xi[0]), y(xi[1]), z(xi[2]);
    V density(0.0f), squares(0.0f), sum_x(0.0f), sum_y(0.0f), sum_z(0.0f);
    V pull_x(0.0f), pull_y(0.0f), pull_z(0.0f);
    for (int k = neighbors.begin[i]; k < neighbors.begin[i + 1]; k += V::kWidth) {
      const Vector3<V> xj = Gather<V>(p.position, neighbors.index + k);
      const V dx = x - xj.x, dy = y - xj.y, dz = z - xj.z;
      const V squared = Max(MultiplyAdd(dx, dx, MultiplyAdd(dy, dy, dz * dz)), tiny);
      const V inverse = InverseSqrt(squared);
      const V q = squared * inverse * inverse_radius;
      const V s = Max(one - q, zero);
      const V s2 = s * s;
      density = MultiplyAdd(s2, s, density);
      squares = MultiplyAdd(s2, s2, squares);
      const V scale = s2 * inverse;
      const V e_x = scale * dx, e_y = scale * dy, e_z = scale * dz;
      e_x.Store(ex + k);
      e_y.Store(ey + k);
      e_z.Store(ez + k);
      sum_x = sum_x + e_x;
      sum_y = sum_y + e_y;
      sum_z = sum_z + e_z;
      if (kCohesive) {
        const V pull = attraction * q * q * s * inverse;
        pull_x = MultiplyAdd(pull, dx, pull_x);
        pull_y = MultiplyAdd(pull, dy, pull_y);
        pull_z = MultiplyAdd(pull, dz, pull_z);
      }
    }
    float* correction = p.correction + 4 * i;
    correction[0] = kCohesive ? Sum(pull_x) : 0.0f;
    correction[1] = kCohesive ? Sum(pull_y) : 0.0f;
    correction[2] = kCohesive ? Sum(pull_z) : 0.0f;
    const float* wall = p.wall_gradient + 4 * i;
    const float gx = Sum(sum_x) + wall[0], gy = Sum(sum_y) + wall[1], gz = Sum(sum_z) + wall[2];
    const float excess = (Sum(density) + p.wall_density[i]) / fluid.rest_density - 1.0f;
    const float length = gx * gx + gy * gy + gz * gz + Sum(squares);
    if (excess > kCrowded) *p.crowded = true;
    p.pressure[i] = excess > 0.0f ? excess / (length + 1e-6f) : 0.0f;
    float* gradient = p.gradient + 4 * i;
    gradient[0] = gx;
    gradient[1] = gy;
    gradient[2] = gz;
  }
}

template <class V>
void FindPressure(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors) {
  if (fluid.cohesion > 0) {
    FindPressureOf<V, true>(fluid, p, neighbors);
  } else {
    FindPressureOf<V, false>(fluid, p, neighbors);
  }
}

template <class V>
void AddCorrection(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors) {
  const float scale = fluid.relaxation * fluid.rest_density * fluid.radius / 3.0f;
  const float *ex = neighbors.e, *ey = ex + neighbors.stride, *ez = ey + neighbors.stride;
  for (int i = 0; i < p.count; ++i) {
    V x(0.0f), y(0.0f), z(0.0f);
    for (int k = neighbors.begin[i]; k < neighbors.begin[i + 1]; k += V::kWidth) {
      const V pressure = V::Pick(p.pressure, neighbors.index + k);
      x = MultiplyAdd(pressure, V::Load(ex + k), x);
      y = MultiplyAdd(pressure, V::Load(ey + k), y);
      z = MultiplyAdd(pressure, V::Load(ez + k), z);
    }
    const float own = p.pressure[i];
    const float *gradient = p.gradient + 4 * i;
    const float dx = scale * (Sum(x) + own * gradient[0]);
    const float dy = scale * (Sum(y) + own * gradient[1]);
    const float dz = scale * (Sum(z) + own * gradient[2]);
    const float squared = dx * dx + dy * dy + dz * dz;
    const float limit = fluid.correction;
    const float clamp = squared > limit * limit ? limit / sqrtf(squared) : 1.0f;
    float* correction = p.correction + 4 * i;
    correction[0] += clamp * dx;
    correction[1] += clamp * dy;
    correction[2] += clamp * dz;
  }
}

template <class V>
void Smooth(const FluidConstants& fluid, const Particles& p, const Neighbors& neighbors,
            float viscosity) {
  const V one(1.0f), zero(0.0f), inverse_radius(1.0f / fluid.radius), tiny(kTiny);
  for (int i = 0; i < p.count; ++i) {
    const float *xi = p.position + 4 * i, *vi = p.velocity + 4 * i;
    const V x(xi[0]), y(xi[1]), z(xi[2]), u(vi[0]), v(vi[1]), w(vi[2]);
    V sum_u(0.0f), sum_v(0.0f), sum_w(0.0f);
    for (int k = neighbors.begin[i]; k < neighbors.begin[i + 1]; k += V::kWidth) {
      const Vector3<V> xj = Gather<V>(p.position, neighbors.index + k);
      const Vector3<V> vj = Gather<V>(p.velocity, neighbors.index + k);
      const V dx = x - xj.x, dy = y - xj.y, dz = z - xj.z;
      const V squared = Max(MultiplyAdd(dx, dx, MultiplyAdd(dy, dy, dz * dz)), tiny);
      const V s = Max(one - squared * InverseSqrt(squared) * inverse_radius, zero);
      const V weight = s * s * s;
      sum_u = MultiplyAdd(weight, vj.x - u, sum_u);
      sum_v = MultiplyAdd(weight, vj.y - v, sum_v);
      sum_w = MultiplyAdd(weight, vj.z - w, sum_w);
    }
    float* change = p.correction + 4 * i;
    change[0] = viscosity * Sum(sum_u);
    change[1] = viscosity * Sum(sum_v);
    change[2] = viscosity * Sum(sum_w);
  }
}

template <class V>
void FindDistance(const WallPairs& pairs, const float* position, float* distance) {
  Vector3<V> normal;
  for (int k = 0; k < pairs.count; k += V::kWidth) {
    const Vector3<V> local = ToLocal(pairs.end, Gather<V>(position, pairs.particle + k));
    Distance<V>(pairs.shape, pairs.size, local, &normal).Store(distance + k);
  }
}

// What lies behind the tangent plane at distance d counts as filled with water at rest. With
// u = 1 - d/H the integral of the kernel over it is proportional to u^5 (1/20 - u/30).
template <class V>
void FindWallShare(const FluidConstants& fluid, const Particles& p, const WallPairs& pairs) {
  const V zero(0.0f), one(1.0f), inverse_radius(1.0f / fluid.radius);
  const V scale(fluid.wall_density / fluid.rest_density);
  const V slope_scale(fluid.wall_density / 3.0f);
  for (int k = 0; k < pairs.count; k += V::kWidth) {
    const Vector3<V> x = Gather<V>(p.position, pairs.particle + k);
    Vector3<V> local_normal;
    const V d = Distance<V>(pairs.shape, pairs.size, ToLocal(pairs.end, x), &local_normal);
    const Vector3<V> normal = Rotate(pairs.end, local_normal);
    const V u = Min(Max(one - d * inverse_radius, zero), one);
    const V u4 = Square(u * u);
    const V share = scale * u4 * u * (V(1.0f / 20.0f) - u * V(1.0f / 30.0f));
    const V slope = slope_scale * u4 * (V(0.25f) - u * V(0.2f));
    normal.x.Store(pairs.normal + k);
    normal.y.Store(pairs.normal + pairs.stride + k);
    normal.z.Store(pairs.normal + 2 * pairs.stride + k);
    share.Store(pairs.share + k);
    slope.Store(pairs.slope + k);
    for (int lane = k; lane < k + V::kWidth; ++lane) {
      p.free_share[pairs.particle[lane]] *= 1.0f - pairs.share[lane];
    }
  }
}

// Several walls together fill 1 - prod(1 - share), exact where they are orthogonal.
template <class V>
void AddWallGradient(const Particles& p, const WallPairs& pairs) {
  const float *nx = pairs.normal, *ny = nx + pairs.stride, *nz = ny + pairs.stride;
  for (int k = 0; k < pairs.count; ++k) {
    const int i = pairs.particle[k];
    pairs.slope[k] *= p.free_share[i] / (1.0f - pairs.share[k]);
    float* gradient = p.wall_gradient + 4 * i;
    gradient[0] += pairs.slope[k] * nx[k];
    gradient[1] += pairs.slope[k] * ny[k];
    gradient[2] += pairs.slope[k] * nz[k];
  }
}

template <class V>
void Collide(const FluidConstants& fluid, const Particles& p, const WallPairs& pairs,
             double* impulse) {
  const V zero(0.0f), contact(fluid.contact), tiny(kTiny), friction(fluid.friction);
  const V dig_out(kDigOut * fluid.spacing);
  const V wall_push(fluid.relaxation * fluid.rest_density * fluid.radius / 3.0f);
  for (int k = 0; k < pairs.count; k += V::kWidth) {
    const int* particle = pairs.particle + k;
    const Vector3<V> old_x = Gather<V>(p.old_position, particle);
    const Vector3<V> predicted = Gather<V>(p.position, particle);
    const Vector3<V> correction = Gather<V>(p.correction, particle);
    const Vector3<V> x = {predicted.x + correction.x, predicted.y + correction.y,
                          predicted.z + correction.z};
    const Vector3<V> from = ToLocal(pairs.start, old_x), to = ToLocal(pairs.end, x);
    Vector3<V> normal;
    const V old_distance = Distance<V>(pairs.shape, pairs.size, from, &normal);
    // The way relative to the wall, shortened so that it cannot pass it.
    Vector3<V> way = {to.x - from.x, to.y - from.y, to.z - from.z};
    const V length = Dot(way, way);
    const V limit = Select(Less(zero, old_distance), V(kApproach) * old_distance, contact);
    const V shorten = Min(limit * InverseSqrt(Max(length, tiny)), V(1.0f));
    way = {way.x * shorten, way.y * shorten, way.z * shorten};
    const Vector3<V> reached = {from.x + way.x, from.y + way.y, from.z + way.z};
    const V distance = Distance<V>(pairs.shape, pairs.size, reached, &normal);
    const V push = Min(Max(contact - distance, zero), Select(Less(zero, distance), contact, dig_out));
    // Coulomb friction against the push of the contact and of the pressure.
    const V pressure_push = wall_push * V::Pick(p.pressure, particle) * V::Load(pairs.slope + k);
    const V along = Dot(way, normal);
    const Vector3<V> slide = {way.x - along * normal.x, way.y - along * normal.y,
                              way.z - along * normal.z};
    const V grip = Min(friction * (push + pressure_push) *
                           InverseSqrt(Max(Dot(slide, slide), tiny)), V(1.0f));
    const Vector3<V> local = {reached.x + push * normal.x - grip * slide.x,
                              reached.y + push * normal.y - grip * slide.y,
                              reached.z + push * normal.z - grip * slide.z};
    Vector3<V> change = Rotate<V>(pairs.end, {local.x - to.x, local.y - to.y, local.z - to.z});
    Add<V>(p.correction, particle, change);
    if (impulse) {
      float c[3 * kMaxWidth], q[3 * kMaxWidth];
      const V nx = V::Load(pairs.normal + k), ny = V::Load(pairs.normal + pairs.stride + k),
              nz = V::Load(pairs.normal + 2 * pairs.stride + k);
      MultiplyAdd(pressure_push, nx, change.x).Store(c);
      MultiplyAdd(pressure_push, ny, change.y).Store(c + V::kWidth);
      MultiplyAdd(pressure_push, nz, change.z).Store(c + 2 * V::kWidth);
      (x.x + change.x).Store(q);
      (x.y + change.y).Store(q + V::kWidth);
      (x.z + change.z).Store(q + 2 * V::kWidth);
      for (int lane = 0; lane < V::kWidth; ++lane) {
        if (particle[lane] == p.count) continue;  // Padding.
        const double cx = c[lane], cy = c[lane + V::kWidth], cz = c[lane + 2 * V::kWidth];
        const double qx = q[lane], qy = q[lane + V::kWidth], qz = q[lane + 2 * V::kWidth];
        impulse[0] -= cx;
        impulse[1] -= cy;
        impulse[2] -= cz;
        impulse[3] -= qy * cz - qz * cy;
        impulse[4] -= qz * cx - qx * cz;
        impulse[5] -= qx * cy - qy * cx;
      }
    }
  }
}

template <class V>
constexpr Kernels MakeKernels() {
  return {V::kWidth,        FindNeighbors<V>, FindPressure<V>,    AddCorrection<V>, Smooth<V>,
          FindDistance<V>,  FindWallShare<V>,  AddWallGradient<V>, Collide<V>};
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_KERNELS_IMPL_H_
