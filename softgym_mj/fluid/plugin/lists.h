// Lists of particles near each other and near walls by SIMD, under the restrictions of kernels.h.

#ifndef SOFTGYM_MJ_FLUID_LISTS_H_
#define SOFTGYM_MJ_FLUID_LISTS_H_

#include "fluid/plugin/motion.h"
#include "fluid/plugin/particles.h"
#include "native/compression.h"

namespace softgym_mj {
namespace {

constexpr int kChunk = 256;      // Number of candidates after which a list may be full; whole vectors.
constexpr float kEmpty = 1e30f;  // Negative extent of an empty bounding box [m].

// Copies the particles in and around a cell that are nearer than the root of `limit` to the bounding box of those in
// it, padded by distant ones; returns their number. Rounding is monotonic: no particle is nearer to another one than to
// a box around it, as both distances are computed in the same way.
int FindCandidates(const Particles& p, const Grid& grid, int cx, int cy, int cz, Lanes limit, const Candidates& out) {
  const int cell = cx + grid.nx * (cy + grid.ny * cz);
  float low[3] = {kEmpty, kEmpty, kEmpty}, high[3] = {-kEmpty, -kEmpty, -kEmpty};
  for (int i = grid.start[cell]; i < grid.start[cell + 1]; ++i) {
    const float x[3] = {p.x[i], p.y[i], p.z[i]};
    for (int k = 0; k < 3; ++k) {
      low[k] = x[k] < low[k] ? x[k] : low[k];
      high[k] = x[k] > high[k] ? x[k] : high[k];
    }
  }
  const Vec3<Lanes> lows = {Lanes(low[0]), Lanes(low[1]), Lanes(low[2])};
  const Vec3<Lanes> highs = {Lanes(high[0]), Lanes(high[1]), Lanes(high[2])};
  const auto excess = [](Lanes x, Lanes a, Lanes b) { return Max(Max(a - x, x - b), Lanes(0.0f)); };
  int first[kRanges], last[kRanges];
  const int ranges = FindRanges(grid, cx, cy, cz, first, last);
  long length = 0;
  for (int r = 0; r < ranges; ++r) {
    for (int k = first[r]; k < last[r]; k += kLanes) {
      const Lanes dx = excess(Lanes::Load(p.x + k), lows.x, highs.x),
                  dy = excess(Lanes::Load(p.y + k), lows.y, highs.y),
                  dz = excess(Lanes::Load(p.z + k), lows.z, highs.z);
      const Compression near(Bits(Less(dx * dx + dy * dy + dz * dz, limit)) & FirstBits(last[r] - k));
      near.Store(p.x + k, out.x + length);
      near.Store(p.y + k, out.y + length);
      near.Store(p.z + k, out.z + length);
      near.StoreFrom(k, out.index + length);
      length += near.count;
    }
  }
  Lanes(kFar).Store(out.x + length);
  Lanes(kFar).Store(out.y + length);
  Lanes(kFar).Store(out.z + length);
  return static_cast<int>(length);
}

// Constants are copied: what follows from them alone leaves the loops, as nothing that is written can be them.
bool FindNeighbors(const Particles& particles, const Grid& grid, float distance, const Neighbors& out) {
  const Particles p = particles;
  const Candidates near = out.candidates;
  const int most = out.most;
  const Lanes limit(distance * distance);
  int* const begin = out.begin;
  uint8_t hits[kChunk / kLanes];
  int length = 0, cell = 0;
  for (int cz = 0; cz < grid.nz; ++cz) {
    for (int cy = 0; cy < grid.ny; ++cy) {
      for (int cx = 0; cx < grid.nx; ++cx, ++cell) {
        const int first = grid.start[cell], last = grid.start[cell + 1];
        if (first == last) continue;
        const int candidates = FindCandidates(p, grid, cx, cy, cz, limit, near);
        // More are written for a moment.
        const long room = (candidates < most ? candidates : most) + kLanes;
        if (length + room * (last - first) + kChunk + kLanes > out.capacity) return false;
        for (int i = first; i < last; ++i) {
          begin[i] = length;
          const Lanes x(p.x[i]), y(p.y[i]), z(p.z[i]);
          int *const list = out.index + length, *const full = list + most, *end = list;
          for (int k = 0; k < candidates && end <= full; k += kChunk) {
            // All tests precede the first write: one loop for both takes a third longer.
            const int stop = k + kChunk < candidates ? k + kChunk : candidates;
            for (int n = k; n < stop; n += kLanes) {
              const Lanes dx = x - Lanes::Load(near.x + n), dy = y - Lanes::Load(near.y + n),
                          dz = z - Lanes::Load(near.z + n);
              const Mask hit = Less(dx * dx + dy * dy + dz * dz, limit) & Differ(near.index + n, i);
              hits[(n - k) / kLanes] = static_cast<uint8_t>(Bits(hit));
            }
            for (int n = k; n < stop; n += kLanes) {
              const Compression chosen(hits[(n - k) / kLanes]);
              chosen.Store(near.index + n, end);
              end += chosen.count;
            }
          }
          if (end > full) {
            end = full;
            *out.too_many = true;
          }
          for (int lane = 0; lane < kLanes; ++lane) end[lane] = p.count;
          length += (static_cast<int>(end - list) + kLanes - 1) / kLanes * kLanes;
        }
      }
    }
  }
  begin[p.count] = length;
  return true;
}

int FindNear(const Particles& p, const WallPairs& pairs, float range, int* list) {
  const bool is_bounded = pairs.shape != Shape::kPlane;
  Lanes low[3], high[3];
  if (is_bounded) {
    float half[3];
    HalfExtents(pairs.shape, pairs.size, half);
    for (int k = 0; k < 3; ++k) {
      const float reach = ReachAlong(pairs.end, half, k, range);
      low[k] = Lanes(pairs.end[k] - reach);
      high[k] = Lanes(pairs.end[k] + reach);
    }
  }
  int length = 0;
  for (int i = 0; i < p.count; i += kLanes) {
    const Vec3<Lanes> x = {Lanes::Load(p.x + i), Lanes::Load(p.y + i), Lanes::Load(p.z + i)};
    unsigned near = FirstBits(p.count - i);
    if (is_bounded) {
      near &= Bits(Less(low[0], x.x) & Less(x.x, high[0]) & Less(low[1], x.y) & Less(x.y, high[1]) & Less(low[2], x.z) &
                   Less(x.z, high[2]));
      if (near == 0) continue;
    }
    Vec3<Lanes> normal;
    const Lanes distance = Distance<Lanes>(pairs.shape, pairs.size, ToLocal(pairs.end, x), &normal);
    const Compression chosen(near & Bits(Less(distance, Lanes(range))));
    chosen.StoreFrom(i, list + length);
    length += chosen.count;
  }
  for (; length % kLanes; ++length) list[length] = p.count;
  return length;
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_LISTS_H_
