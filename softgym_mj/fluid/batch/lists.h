// Lists of particles near each other and near walls, identical to those of `Solver`.

#ifndef SOFTGYM_MJ_FLUID_BATCH_LISTS_H_
#define SOFTGYM_MJ_FLUID_BATCH_LISTS_H_

#include "fluid/batch/environment.h"
#include "fluid/batch/ranges.h"
#include "fluid/plugin/motion.h"
#include "fluid/plugin/particles.h"
#ifndef __CUDACC__
#include "fluid/plugin/lists.h"
#endif

namespace softgym_mj::fluid {
namespace {

// Largest distance of listed pairs when the lists are built.
inline float ListDistance(const Environment& w) { return w.model->fluid.radius + w.step->margin; }

// A wall and the particles near it.
inline WallPairs PairsOf(const Environment& w, int wall) {
  const Model& m = *w.model;
  const long long n = m.count + kLanes;
  float* numbers = w.wall_numbers + 5 * n * wall;
  const BatchWall& own = m.walls[wall];
  const int count = (w.step->pairs[wall] + kLanes - 1) / kLanes * kLanes;
  return {count,
          own.shape,
          own.size,
          w.step->wall_start + 12 * wall,
          w.step->wall_end + 12 * wall,
          w.pair_particle + n * wall,
          numbers,
          numbers + 3 * n,
          numbers + 4 * n,
          static_cast<long>(n)};
}

// Fills `sum` with the sums of number(i, k) over all particles i, for 0 <= k < 3, in the order of `SumInShares`.
template <class T, class F>
inline void SumAll(const Environment& w, F number) {
  const int count = w.model->count, shares = (count + kShare - 1) / kShare;
  Each(3 * shares, [&](int j) {
    const int first = j / 3 * kShare, end = first + kShare < count ? first + kShare : count, k = j % 3;
    T sum = 0;
    SGM_UNROLLED
    for (int i = first; i < end; ++i) sum += number(i, k);
    w.sums[j] = sum;
  });
  Each(3, [&](int k) {
    T sum = 0;
    SGM_UNROLLED
    for (int j = k; j < 3 * shares; j += 3) sum += static_cast<T>(w.sums[j]);
    w.step->sum[k] = sum;
  });
}

// Sets the size of the grid, as `Solver::ShapeGrid`.
inline void ShapeGrid(const Environment& w) {
  const Model& m = *w.model;
  const float cell = m.fluid.radius;
  const float* x = w.particles.position;
  double mean[3];
  SumAll<double>(w, [&](int i, int k) { return x[4 * i + k]; });
  for (int k = 0; k < 3; ++k) mean[k] = w.step->sum[k] / m.count;
  Wait();
  SumAll<double>(w, [&](int i, int k) { return std::fabs(x[4 * i + k] - mean[k]); });
  Once([&] {
    for (int k = 0; k < 3; ++k) w.step->extent[k] = static_cast<float>(4 * w.step->sum[k] / m.count / cell) + 2;
    int size[3] = {4, 4, 4};
    const double* extent = w.step->extent;
    while (size[0] * size[1] * size[2] < m.count) {
      int longest = 0;
      for (int k = 1; k < 3; ++k) {
        if (static_cast<float>(extent[k]) / size[k] > static_cast<float>(extent[longest]) / size[longest]) longest = k;
      }
      if (static_cast<float>(extent[longest]) <= size[longest]) break;
      size[longest] *= 2;
    }
    w.step->nx = size[0], w.step->ny = size[1], w.step->nz = size[2];
  });
}

// Sorts the particles by cell.
inline void Sort(Environment* w) {
  const Model& m = *w->model;
  const Step& step = *w->step;
  const int count = m.count, cells = step.nx * step.ny * step.nz;
  const float inverse = 1.0f / ListDistance(*w);
  const auto wrap = [inverse](float x, int size) { return CellOf(x * inverse) & (size - 1); };
  Each(cells + 2, [&](int c) { w->start[c] = w->fill[c] = 0; });
  Each(count, [&](int i) {
    const float* x = w->particles.position + 4 * i;
    w->cell[i] = wrap(x[0], step.nx) + step.nx * (wrap(x[1], step.ny) + step.ny * wrap(x[2], step.nz));
    Add(&w->start[w->cell[i] + 1], 1);
  });
  SumUp(w->start, cells + 2, w->partial);
  // The sort is stable: `spare_order` holds the particle of each place.
  Each(count, [&](int i) { w->spare_order[w->start[w->cell[i]] + Add(&w->fill[w->cell[i]], 1)] = i; });
  Each(cells, [&](int c) {
    for (int k = w->start[c] + 1; k < w->start[c + 1]; ++k) {
      const int particle = w->spare_order[k];
      int place = k;
      for (; place > w->start[c] && w->spare_order[place - 1] > particle; --place) {
        w->spare_order[place] = w->spare_order[place - 1];
      }
      w->spare_order[place] = particle;
    }
  });
  float** const arrays[] = {&w->particles.position, &w->particles.old_position, &w->particles.velocity};
  for (float** array : arrays) {
    Each(4 * count + 4, [&](int k) {
      const int i = k / 4 < count ? w->spare_order[k / 4] : count;
      w->spare[k] = (*array)[4 * i + k % 4];
    });
    Once([&] {
      float* sorted = w->spare;
      w->spare = *array;
      *array = sorted;
    });
  }
  Each(count, [&](int i) { w->end[i] = w->order[w->spare_order[i]]; });
  float *x = const_cast<float*>(w->particles.x), *y = const_cast<float*>(w->particles.y);
  float* z = const_cast<float*>(w->particles.z);
  Each(count, [&](int i) {
    w->order[i] = w->end[i];
    x[i] = w->particles.position[4 * i];
    y[i] = w->particles.position[4 * i + 1];
    z[i] = w->particles.position[4 * i + 2];
  });
}

#ifdef __CUDACC__

// Lists the neighbors of particle i, as `FindNeighbors` of the kernels. One thread lists all of them because the
// threads of its neighbors read the same particles. It reads a few ahead, and does not wait for other threads after
// each range.
inline void ListNeighborsOf(const Environment& w, int i) {
  constexpr int kAhead = 4;
  static_assert(kAhead <= kLanes, "What is read and written ahead must fit.");
  const Step& step = *w.step;
  const Grid grid = {step.nx, step.ny, step.nz, w.start};
  const float distance = ListDistance(w), inverse = 1.0f / distance, limit = distance * distance;
  const auto* const position = reinterpret_cast<const float4*>(w.particles.position);
  const float4 own = position[i];
  int first[kRanges], last[kRanges];
  const int ranges = FindRanges(grid, CellOf(own.x * inverse) & (step.nx - 1), CellOf(own.y * inverse) & (step.ny - 1),
                                CellOf(own.z * inverse) & (step.nz - 1), first, last);
  const auto count = static_cast<ListIndex>(w.particles.count);
  ListIndex* const index = w.neighbors.index;
  const unsigned begin = static_cast<unsigned>(kListStride) * i, full = begin + kMostNeighbors;
  unsigned next = begin;
  for (int r = 0, k = 0, end = 0; next <= full; k += kAhead) {
    if (k >= end) {
      if (r == ranges) break;
      k = first[r], end = last[r++];
    }
    float4 other[kAhead];
    for (int n = 0; n < kAhead; ++n) other[n] = position[k + n];
    for (int n = 0; n < kAhead; ++n) {
      const float dx = other[n].x - own.x, dy = other[n].y - own.y, dz = other[n].z - own.z;
      const bool near = (dx * dx + dy * dy + dz * dz < limit) & (k + n < end) & (k + n != i);
      if (near) index[next++] = static_cast<ListIndex>(k + n);
    }
  }
  if (next > full) {
    next = full;
    *w.neighbors.too_many = true;
  }
  while (next % kLanes) index[next++] = count;
  w.begin[i] = begin;
  w.end[i] = next;
}

// Lists the neighbors of all particles.
inline void ListNeighbors(Environment* w) {
  Each(w->model->count, [&](int i) { ListNeighborsOf(*w, i); });
}

// Lists the particles near a wall.
inline void ListNear(const Environment& w, int wall, float range) {
  const Model& m = *w.model;
  const BatchWall& own = m.walls[wall];
  const float* pose = w.step->wall_end + 12 * wall;
  int* list = w.pair_particle + static_cast<long long>(m.count + kLanes) * wall;
  const bool in_order = kPushes && own.pushed >= 0;  // Sums of pushes go along the list.
  if (in_order) Each(m.count, [&](int i) { w.cell[i] = 0; });
  Each(m.count, [&](int i) {
    const float* x = w.particles.position + 4 * i;
    if (own.shape != Shape::kPlane) {
      float half[3];
      HalfExtents(own.shape, own.size, half);
      for (int k = 0; k < 3; ++k) {
        const float reach = ReachAlong(pose, half, k, range);
        if (!(x[k] > pose[k] - reach && x[k] < pose[k] + reach)) return;
      }
    }
    Vec3<float> normal;
    const Vec3<float> local = ToLocal(pose, Vec3<float>{x[0], x[1], x[2]});
    if (!(Distance<float>(own.shape, own.size, local, &normal) < range)) return;
    if (in_order) {
      w.cell[i] = 1;
    } else {
      list[Add(&w.step->pairs[wall], 1)] = i;
    }
  });
  if (in_order) {
    SumUp(w.cell, m.count, w.partial);
    Each(m.count, [&](int i) {
      const int before = i > 0 ? w.cell[i - 1] : 0;
      if (w.cell[i] > before) list[before] = i;
      if (i == m.count - 1) w.step->pairs[wall] = w.cell[i];
    });
  }
  const int near = w.step->pairs[wall];
  Each((near + kLanes - 1) / kLanes * kLanes - near, [&](int k) { list[near + k] = m.count; });
}

#else

static_assert(kListRoom >= kChunk + kLanes, "Every list must fit.");

// Lists the neighbors of all particles by the plugin's kernel, because one thread does all of them.
inline void ListNeighbors(Environment* w) {
  const Grid grid = {w->step->nx, w->step->ny, w->step->nz, w->start};
  w->neighbors.end = w->begin + 1;
  FindNeighbors(w->particles, grid, ListDistance(*w), w->neighbors);
}

// Lists the particles near a wall by the plugin's kernel.
inline void ListNear(const Environment& w, int wall, float range) {
  const WallPairs pairs = PairsOf(w, wall);
  w.step->pairs[wall] = FindNear(w.particles, pairs, range, const_cast<int*>(pairs.particle));
}

#endif  // __CUDACC__

// Lists the particles near each wall.
inline void ListPairs(const Environment& w) {
  const Model& m = *w.model;
  const float range = m.fluid.radius + (w.step->margin > 0 ? kWallSkin * m.fluid.spacing : 0);
  Each(12 * m.num_walls, [&](int k) { w.step->wall_built[k] = w.step->wall_end[k]; });
  Each(m.num_walls, [&](int wall) { w.step->pairs[wall] = 0; });
  for (int wall = 0; wall < m.num_walls; ++wall) ListNear(w, wall, range);
}

// Finds the mean of vectors at(i, 0..2) of the particles, and their two largest squared deviations from it.
template <class F>
inline void FindDeviations(const Environment& w, F at) {
  const Model& m = *w.model;
  Step* step = w.step;
  SumAll<float>(w, at);
  Each(3, [&](int k) {
    step->mean[k] = static_cast<float>(step->sum[k]) / static_cast<float>(m.count);
    if (k > 0) return;
    step->first = step->second = 0;
    step->expired = step->repeated = 0;
  });
  const auto squared = [&](int i) { return SquaredDeviation([&](int k) { return at(i, k); }, step->mean); };
  Each(m.count, [&](int i) { TakeLargest(&step->first, squared(i)); });
  Each(m.count, [&](int i) {
    const float own = squared(i);
    if (own < step->first) {
      TakeLargest(&step->second, own);
    } else {
      Add(&step->repeated, 1);
    }
  });
}

// The second largest deviation, after `FindDeviations`.
inline float SecondDeviation(const Step& step) { return std::sqrt(step.repeated > 1 ? step.first : step.second); }

inline void BuildLists(Environment* w, int later) {
  const Model& m = *w->model;
  Step* step = w->step;
  const float* v = w->particles.velocity;
  FindDeviations(*w, [v](int i, int k) { return v[4 * i + k]; });
  Once([&] { step->margin = ListMargin(m.fluid, m.h * (std::sqrt(step->first) + SecondDeviation(*step)), later); });
  Sort(w);
  ListNeighbors(w);
  Each(4 * m.count, [&](int k) { w->built[k] = w->particles.position[k]; });
  ListPairs(*w);
}

// Whether the lists must be rebuilt, as `Solver::ListsExpired`.
inline bool ListsExpired(const Environment& w) {
  const Model& m = *w.model;
  Step* step = w.step;
  if (step->margin == 0) return true;
  const float *now = w.particles.position, *built = w.built;
  FindDeviations(w, [now, built](int i, int k) { return now[4 * i + k] - built[4 * i + k]; });
  Each(m.num_walls + 1, [&](int wall) {
    float other, margin = kWallSkin * m.fluid.spacing;
    if (wall < m.num_walls) {
      const BatchWall& own = m.walls[wall];
      other = WallMotion(own.shape, own.size, step->wall_end + 12 * wall, step->wall_built + 12 * wall, step->mean);
    } else {
      other = SecondDeviation(*step);
      margin = step->margin;
    }
    if (std::sqrt(step->first) + other > margin) SetBits(&step->expired, 1);
  });
  return step->expired;
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_LISTS_H_
