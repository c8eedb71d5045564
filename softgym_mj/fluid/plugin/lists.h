// Lists of particles near each other and near walls by SIMD, under the restrictions of kernels.h.

#ifndef SOFTGYM_MJ_FLUID_LISTS_H_
#define SOFTGYM_MJ_FLUID_LISTS_H_

#include "fluid/plugin/motion.h"
#include "fluid/plugin/particles.h"
#include "native/compression.h"

namespace softgym_mj {
namespace {

constexpr int kChunk = 256;      // Number of candidates after which a list may be full; whole vectors.
constexpr int kRows = 9;         // Rows of cells in and around one.
constexpr float kEmpty = 1e30f;  // Negative extent of an empty bounding box [m].

// Groups of up to eight particles side by side: the first of each, and the lanes that count, as bits.
struct Groups {
  static constexpr int kMost = 512, kUsual = 4;
  int count = 0;
  int first[kMost + 2 * kRows * kUsual];
  uint8_t lanes[kMost + 2 * kRows * kUsual];

  // Adds the particles begin..end-1. Calls `empty`, which sets `count` to 0, if there are many groups.
  template <class F>
  void Add(int begin, int end, F empty) {
    const int size = end - begin, more = (size + kLanes - 1) / kLanes;
    if (more > kUsual) {
      for (int n = 0; n < size; n += kLanes) {
        if (count >= kMost) empty();
        first[count] = begin + n;
        lanes[count++] = static_cast<uint8_t>(FirstBits(size - n));
      }
      return;
    }
    // The same stores for any number: the ends of loops of different lengths would be mispredicted.
    for (int n = 0; n < kUsual; ++n) {
      first[count + n] = begin + kLanes * n;
      lanes[count + n] = 0xff;
    }
    lanes[count + (more > 0 ? more - 1 : 0)] = static_cast<uint8_t>(0xff >> (-size & (kLanes - 1)));
    count += more;
  }
};

// A box around particles.
struct Box {
  Vec3<Lanes> low, high;
};
inline Box FindBox(const Particles& p, int first, int last) {
  const float* const axes[3] = {p.x, p.y, p.z};
  Lanes low[3] = {Lanes(kEmpty), Lanes(kEmpty), Lanes(kEmpty)};
  Lanes high[3] = {Lanes(-kEmpty), Lanes(-kEmpty), Lanes(-kEmpty)};
  for (int i = first; i < last; i += kLanes) {
    const Mask own = FirstLanes(last - i);
    for (int k = 0; k < 3; ++k) {
      const Lanes x = Lanes::Load(axes[k] + i);
      low[k] = Min(Select(own, x, low[k]), low[k]);
      high[k] = Max(Select(own, x, high[k]), high[k]);
    }
  }
  return {{Least(low[0]), Least(low[1]), Least(low[2])}, {Largest(high[0]), Largest(high[1]), Largest(high[2])}};
}

// Appends the particles of groups that are nearer than the root of `limit` to a box to `length` others; returns the
// number of all. Rounding is monotonic: no particle is nearer to another one than to a box around it, as both distances
// are computed in the same way.
inline long CopyNear(const Particles& p, const Groups& groups, const Box& box, Lanes limit, const Candidates& out,
                     long length) {
  const auto excess = [](Lanes x, Lanes a, Lanes b) { return Max(Max(a - x, x - b), Lanes(0.0f)); };
  for (int n = 0; n < groups.count; ++n) {
    const int k = groups.first[n];
    const Lanes dx = excess(Lanes::Load(p.x + k), box.low.x, box.high.x),
                dy = excess(Lanes::Load(p.y + k), box.low.y, box.high.y),
                dz = excess(Lanes::Load(p.z + k), box.low.z, box.high.z);
    const Compression near(Bits(Less(dx * dx + dy * dy + dz * dz, limit)) & groups.lanes[n]);
    near.Store(p.x + k, out.x + length);
    near.Store(p.y + k, out.y + length);
    near.Store(p.z + k, out.z + length);
    near.StoreFrom(k, out.index + length);
    length += near.count;
  }
  return length;
}

// Copies the particles in and around the cells cx and cx + 1 of a row that are nearer than the root of `limit` to the
// bounding box of those in them, padded by distant ones; returns their number. `rows`: first cells of the rows around.
// A row is one range of particles or, where it wraps, two.
int FindCandidates(const Particles& p, const Grid& grid, const int* rows, int cx, Lanes limit, const Candidates& out) {
  const int nx = grid.nx, end = cx + 2, left = cx > 0 ? cx - 1 : 0, right = end < nx ? end + 1 : nx;
  const int other = cx > 0 ? 0 : nx - 1;
  const bool wraps = cx == 0 || end == nx;
  const int* const own = grid.start + rows[kRows / 2];
  const Box box = FindBox(p, own[cx], own[end]);
  Groups groups;
  long length = 0;
  const auto copy = [&] {
    length = CopyNear(p, groups, box, limit, out, length);
    groups.count = 0;
  };
  for (int r = 0; r < kRows; ++r) {
    const int* const start = grid.start + rows[r];
    groups.Add(start[left], start[right], copy);
    if (wraps) groups.Add(start[other], start[other + 1], copy);
  }
  copy();
  Lanes(kFar).Store(out.x + length);
  Lanes(kFar).Store(out.y + length);
  Lanes(kFar).Store(out.z + length);
  return static_cast<int>(length);
}

// Constants are copied: what follows from them alone leaves the loops, as nothing that is written can be them.
// Two cells side by side share their candidates: half as many searches save more than the additional tests cost.
// Particles two cells apart are further apart than `distance`, but for the rounding of cells.
bool FindNeighbors(const Particles& particles, const Grid& grid, float distance, const Neighbors& out) {
  const Particles p = particles;
  const Candidates near = out.candidates;
  const int most = out.most;
  const Lanes limit(distance * distance);
  int* const begin = out.begin;
  uint8_t hits[kChunk / kLanes];
  int length = 0;
  for (int row = 0; row < grid.ny * grid.nz; ++row) {
    const int* const start = grid.start + grid.nx * row;
    if (start[0] == start[grid.nx]) continue;
    const int y = row & (grid.ny - 1), z = row / grid.ny;
    int rows[kRows];
    for (int r = 0; r < kRows; ++r) {
      rows[r] = grid.nx * (((y + r % 3 - 1) & (grid.ny - 1)) + grid.ny * ((z + r / 3 - 1) & (grid.nz - 1)));
    }
    for (int cx = 0; cx < grid.nx; cx += 2) {
      const int first = start[cx], last = start[cx + 2];
      if (first == last) continue;
      const int candidates = FindCandidates(p, grid, rows, cx, limit, near);
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
          uint8_t* hit = hits;
          for (int n = k; n < stop; n += kLanes) {
            const Lanes dx = x - Lanes::Load(near.x + n), dy = y - Lanes::Load(near.y + n),
                        dz = z - Lanes::Load(near.z + n);
            const Mask close = Less(dx * dx + dy * dy + dz * dz, limit);
            *hit++ = static_cast<uint8_t>(Bits(Differing(near.index + n, i, close)));
          }
          hit = hits;
          for (int n = k; n < stop; n += kLanes) {
            const Compression chosen(*hit++);
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
