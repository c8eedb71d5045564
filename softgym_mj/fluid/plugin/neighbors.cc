// Lists of particles near each other and near walls, which a `Solver` keeps for some substeps.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "native/simd.h"
#include "solver.h"

namespace softgym_mj {
namespace {

// Limit of pairs, 16 bytes each, because coincident particles form pairs of all with all. There is always room for five
// times as many neighbors of a particle as in water at rest.
constexpr int kMaxPairs = 1 << 24;
constexpr int kMaxNeighbors = 256;

// Mean of vectors, and their two largest deviations from it.
struct Deviations {
  float mean[3], first, second;
};

// `Deviations` of the vectors at(i, 0..2), 0 <= i < count.
template <class F>
Deviations FindDeviations(int count, F at) {
  Deviations out = {};
  const auto sum = SumInShares<Vec3<float>>(count, [&](int i) { return Vec3<float>{at(i, 0), at(i, 1), at(i, 2)}; });
  const float number = static_cast<float>(count), sums[3] = {sum.x, sum.y, sum.z};
  for (int k = 0; k < 3; ++k) out.mean[k] = sums[k] / number;
  for (int i = 0; i < count; ++i) {
    const float squared = SquaredDeviation([&](int k) { return at(i, k); }, out.mean);
    if (squared > out.second) {
      out.second = std::min(out.first, squared);
      out.first = std::max(out.first, squared);
    }
  }
  out.first = std::sqrt(out.first);
  out.second = std::sqrt(out.second);
  return out;
}

int RoundUp(int n, int step) { return (n + step - 1) / step * step; }

}  // namespace

// Chooses the numbers of cells along the axes: about as many cells as particles, in the proportions
// of the fluid. The extent is four mean deviations, the length of a column, which a stray drop hardly affects.
void Solver::ShapeGrid() {
  const float cell = fluid_.radius;
  float extent[3];
  for (int k = 0; k < 3; ++k) {
    const float* x = p_.position + k;
    const double mean = SumInShares<double>(count_, [&](int i) { return x[4 * i]; }) / count_;
    const double deviation = SumInShares<double>(count_, [&](int i) { return std::fabs(x[4 * i] - mean); });
    extent[k] = static_cast<float>(4 * deviation / count_ / cell) + 2;
  }
  int size[3] = {4, 4, 4};
  while (size[0] * size[1] * size[2] < count_) {
    int longest = 0;
    for (int k = 1; k < 3; ++k) {
      if (extent[k] / size[k] > extent[longest] / size[longest]) longest = k;
    }
    if (extent[longest] <= size[longest]) break;
    size[longest] *= 2;
  }
  grid_.nx = size[0];
  grid_.ny = size[1];
  grid_.nz = size[2];
}

// Sorts the particles by cell.
void Solver::Sort(float cell) {
  const int cells = grid_.nx * grid_.ny * grid_.nz;
  int* start = start_.Reserve(cells + 2);
  grid_.start = start;
  std::fill(start, start + cells + 2, 0);
  const float inverse = 1.0f / cell;
  const auto wrap = [inverse](float x, int size) { return CellOf(x * inverse) & (size - 1); };
  int* index = cell_.get();
  for (int i = 0; i < count_; ++i) {
    const float* x = p_.position + 4 * i;
    index[i] = wrap(x[0], grid_.nx) + grid_.nx * (wrap(x[1], grid_.ny) + grid_.ny * wrap(x[2], grid_.nz));
    ++start[index[i] + 2];
  }
  for (int c = 2; c < cells + 2; ++c) start[c] += start[c - 1];
  // start[c + 1] is where cell c is filled; afterwards it is where cell c ends.
  int* to = spare_order_.get();
  for (int i = 0; i < count_; ++i) to[i] = start[index[i] + 1]++;
  for (Buffer<float>* array : {&position_, &old_position_, &velocity_}) {
    const float* from = array->get();
    float* sorted = spare_.get();
    for (int i = 0; i < count_; ++i) std::memcpy(sorted + 4 * to[i], from + 4 * i, 16);
    std::memcpy(sorted + 4 * count_, from + 4 * count_, 16);
    std::swap(*array, spare_);
  }
  p_.position = position_.get();
  p_.old_position = old_position_.get();
  p_.velocity = velocity_.get();
  for (int i = 0; i < count_; ++i) index[to[i]] = order_.get()[i];
  std::swap(order_, cell_);
  float *x = x_.get(), *y = y_.get(), *z = z_.get();
  for (int i = 0; i < count_; ++i) {
    x[i] = p_.position[4 * i];
    y[i] = p_.position[4 * i + 1];
    z[i] = p_.position[4 * i + 2];
  }
}

// Moves coincident particles in individual random directions.
void Solver::Separate() {
  const int cells = grid_.nx * grid_.ny * grid_.nz;
  const auto compare = [this](int i, int j) {
    return std::memcmp(p_.position + 4 * i, p_.position + 4 * j, 3 * sizeof(float));
  };
  // Whether particles first..last-1, if they are few, are all at different x.
  const auto differ = [this](int first, int last) {
    constexpr int kFew = 16;
    if (last - first > kFew) return false;
    for (int i = first; i < last; ++i) {
      for (int j = first; j < i; ++j) {
        if (std::memcmp(p_.position + 4 * i, p_.position + 4 * j, sizeof(float)) == 0) return false;
      }
    }
    return true;
  };
  for (int c = 0; c < cells; ++c) {
    const int first = grid_.start[c], last = grid_.start[c + 1];
    if (differ(first, last)) continue;
    // Sorted, as a cell may hold all particles there are.
    in_cell_.resize(last - first);
    std::iota(in_cell_.begin(), in_cell_.end(), first);
    std::sort(in_cell_.begin(), in_cell_.end(), [&compare](int i, int j) {
      const int order = compare(i, j);
      return order != 0 ? order < 0 : i < j;
    });
    for (size_t k = 1; k < in_cell_.size(); ++k) {
      const int i = in_cell_[k];
      if (compare(in_cell_[k - 1], i) != 0) continue;
      unsigned random = static_cast<unsigned>(order_.get()[i]);
      for (int axis = 0; axis < 3; ++axis) {
        p_.correction[4 * i + axis] += kNudge * fluid_.spacing * NudgeAlong(&random);
      }
    }
  }
}

void Solver::BuildLists(float h, int later) {
  const float* v = p_.velocity;
  const Deviations velocity = FindDeviations(count_, [v](int i, int k) { return v[4 * i + k]; });
  margin_ = ListMargin(fluid_, h * (velocity.first + velocity.second), later);
  const float distance = fluid_.radius + margin_;
  Sort(distance);
  long capacity = std::max<long>(static_cast<long>(index_.size()), 48L * count_ + 4096);
  neighbors_.most = std::max(kMaxNeighbors, kMaxPairs / count_);
  for (;; capacity *= 2) {
    neighbors_.index = index_.Reserve(capacity);
    neighbors_.capacity = capacity;
    if (kernels_->FindNeighbors(p_, grid_, distance, neighbors_)) break;
  }
  neighbors_.stride = RoundUp(neighbors_.begin[count_] + kLanes, kLanes);
  neighbors_.e = e_.Reserve(3 * neighbors_.stride);
  std::memcpy(built_position_.get(), p_.position, 4 * sizeof(float) * count_);
  FindPairs();
}

// Lists the particles near each wall.
void Solver::FindPairs() {
  const float range = fluid_.radius + (margin_ > 0 ? kWallSkin * fluid_.spacing : 0);
  const int most = count_ + kLanes;
  const int num_walls = static_cast<int>(walls_->size());
  wall_built_ = wall_end_;
  int* particle = pair_particle_.Reserve(static_cast<size_t>(most) * num_walls);
  long total = 0;
  for (int w = 0; w < num_walls; ++w) {
    const Wall& wall = (*walls_)[w];
    WallPairs& pairs = pairs_[w];
    pairs.shape = wall.shape;
    pairs.size = wall.size;
    pairs.start = &wall_start_[12 * w];
    pairs.end = &wall_end_[12 * w];
    pairs.particle = particle + total;
    pairs.count = kernels_->FindNear(p_, pairs, range, particle + total);
    total += pairs.count;
  }
  const long stride = RoundUp(static_cast<int>(total) + kLanes, kLanes);
  float* numbers = pair_numbers_.Reserve(5 * stride);
  long first = 0;
  for (WallPairs& pairs : pairs_) {
    pairs.stride = stride;
    pairs.normal = numbers + first;
    pairs.share = numbers + 3 * stride + first;
    pairs.slope = numbers + 4 * stride + first;
    first += pairs.count;
  }
}

// Whether a pair that is in no list could have come into reach. Two particles have moved relative to
// each other by at most the two largest deviations from the mean displacement; motion of everything
// together does not count.
bool Solver::ListsExpired() const {
  if (margin_ == 0) return true;
  const float *now = p_.position, *built = built_position_.get();
  const Deviations moved =
      FindDeviations(count_, [now, built](int i, int k) { return now[4 * i + k] - built[4 * i + k]; });
  if (moved.first + moved.second > margin_) return true;
  for (size_t w = 0; w < walls_->size(); ++w) {
    const Wall& wall = (*walls_)[w];
    const float way = WallMotion(wall.shape, wall.size, &wall_end_[12 * w], &wall_built_[12 * w], moved.mean);
    if (moved.first + way > kWallSkin * fluid_.spacing) return true;
  }
  return false;
}

}  // namespace softgym_mj
