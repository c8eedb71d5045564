// Lists of flex elements near each particle. A particle keeps its list until it or the flexes have moved too far; a new
// list is read from a grid of the elements.

#include <algorithm>
#include <cmath>

#include "flex_boundary.h"

namespace softgym_mj {
namespace {

// [spacings] Margin of the lists beyond the interaction range.
constexpr double kSkin = 0.3;
// A surface counts up to this share of the kernel's support: beyond it fills less than 0.2 %.
constexpr double kReach = 0.75;
// [spacings] Rounding error of positions and bounds in single precision.
constexpr double kSlack = 1e-3;
// [spacings] Largest displacement of a particle in a substep in addition to its velocity.
constexpr double kPushed = 1.0;
constexpr int kCells = 16;  // Along an axis of the grid, which is wrapped.
// Width of a cell in distances at which surfaces are listed. 1 to 2 cost the same.
constexpr double kCellWidth = 1.5;
// An element in more cells than this is outside the grid and checked for every particle, which limits a crumpled cloth
// of any size to 100 MB.
constexpr int kMostCells = 1024;
constexpr size_t kMostEntries = 1 << 23;
// Largest number of stored elements near a particle, enough for two layers of the finest cloth, and of all particles
// together (100 MB).
constexpr int kMostCandidates = 512, kMostInAll = 1 << 23;

double Component(Vector a, int k) { return k == 0 ? a.x : k == 1 ? a.y : a.z; }

int Wrapped(int x, int y, int z) {
  constexpr int kMask = kCells - 1;
  return (x & kMask) + kCells * ((y & kMask) + kCells * (z & kMask));
}

}  // namespace

double FlexBoundary::Reach() const { return kReach * fluid_.radius; }

double FlexBoundary::ListDistance(const FlexElement& e) const { return e.radius + Reach() + kSkin * fluid_.spacing; }

void FlexBoundary::Begin(const FlexMotion& motion, const double origin[3], const FluidConstants& fluid,
                         const Particles& p, double way, int substeps) {
  motion_ = &motion;
  fluid_ = fluid;
  slack_ = static_cast<float>(kSlack * fluid.spacing);
  near_.clear();
  used_.clear();
  active_ = too_many_ = false;
  if (motion.elements.empty()) return;
  fraction_ = furthest_ = 0;
  const size_t count = motion.end.size() / 3;
  from_.resize(count);
  move_.resize(count);
  start_.resize(count);
  for (size_t v = 0; v < count; ++v) {
    const Vector a = FromArray(&motion.start[3 * v]), b = FromArray(&motion.end[3 * v]);
    from_[v] = a - FromArray(origin);
    move_[v] = b - a;
    furthest_ = std::max(furthest_, Norm(move_[v]));
  }
  end_ = from_;
  // Region that particles can reach in this step.
  const double most = substeps * (way + kPushed * fluid.spacing);
  for (int k = 0; k < 3; ++k) {
    float low = p.position[k], high = low;
    for (int i = 1; i < p.count; ++i) {
      low = std::min(low, p.position[4 * i + k]);
      high = std::max(high, p.position[4 * i + k]);
    }
    low_[k] = low - most;
    high_[k] = high + most;
  }
  FillGrid();
  lists_.assign(active_ ? p.count : 0, {});
  candidates_.clear();
  most_ = std::max(kMostCandidates, kMostInAll / p.count);
}

// Puts the elements that particles can reach in this step into all cells from which they are in reach,
// and shrinks the box to what is in their reach.
void FlexBoundary::FillGrid() {
  const int num_elements = static_cast<int>(motion_->elements.size());
  cell_ = kCellWidth * (Reach() + kSkin * fluid_.spacing);
  bounds_.resize(num_elements);
  is_used_.assign(num_elements, 0);
  cells_.clear();
  entries_.clear();
  everywhere_.clear();
  double box_low[3] = {kNowhere, kNowhere, kNowhere}, box_high[3] = {-kNowhere, -kNowhere, -kNowhere};
  for (int element = 0; element < num_elements; ++element) {
    const FlexElement& e = motion_->elements[element];
    const double range = ListDistance(e) + furthest_;
    int first[3], last[3];
    double low[3], high[3];
    bool apart = false;
    for (int k = 0; k < 3; ++k) {
      const double a = Component(from_[e.vertex[0]], k), b = Component(from_[e.vertex[1]], k),
                   c = Component(from_[e.vertex[2]], k);
      low[k] = std::max(std::min({a, b, c}) - range, low_[k]);
      high[k] = std::min(std::max({a, b, c}) + range, high_[k]);
      apart |= low[k] > high[k];
    }
    if (apart) continue;
    bool wraps = false;  // Whether it covers all cells along an axis of the wrapped grid.
    for (int k = 0; k < 3; ++k) {
      box_low[k] = std::min(box_low[k], low[k]);
      box_high[k] = std::max(box_high[k], high[k]);
      first[k] = CellOf(low[k] / cell_);
      last[k] = CellOf(high[k] / cell_);
      if (last[k] - first[k] < kCells) continue;
      last[k] = first[k] + kCells - 1;
      wraps = true;
    }
    int number = 1;
    for (int k = 0; k < 3; ++k) number *= last[k] - first[k] + 1;
    if (number > kMostCells || cells_.size() > kMostEntries) {
      everywhere_.push_back(element);
      continue;
    }
    const ElementBound bound = MakeBound(e);
    const float most = static_cast<float>(range + 0.5 * std::sqrt(3.0) * cell_);
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) {
          const float center[3] = {static_cast<float>((x + 0.5) * cell_), static_cast<float>((y + 0.5) * cell_),
                                   static_cast<float>((z + 0.5) * cell_)};
          if (!wraps && bound.OutOfReach(center, most, slack_)) continue;
          cells_.push_back(Wrapped(x, y, z));
          entries_.push_back(element);
        }
      }
    }
  }
  active_ = !cells_.empty() || !everywhere_.empty();
  if (!active_) return;
  std::copy(box_low, box_low + 3, low_);
  std::copy(box_high, box_high + 3, high_);
  cell_start_.assign(kCells * kCells * kCells + 2, 0);
  for (int c : cells_) ++cell_start_[c + 2];
  for (size_t c = 2; c < cell_start_.size(); ++c) cell_start_[c] += cell_start_[c - 1];
  // cell_start_[c + 1] is where cell c is filled; afterwards it is where cell c ends.
  in_cell_.resize(cells_.size());
  for (size_t k = 0; k < cells_.size(); ++k) in_cell_[cell_start_[cells_[k] + 1]++] = entries_[k];
}

void FlexBoundary::Place(double fraction) {
  if (!active_) return;
  std::swap(start_, end_);
  for (size_t v = 0; v < end_.size(); ++v) end_[v] = from_[v] + fraction * move_[v];
  longest_ = furthest_ * (fraction - fraction_);
  fraction_ = fraction;
  for (int element : used_) bounds_[element] = MakeBound(motion_->elements[element]);
}

ElementBound FlexBoundary::MakeBound(const FlexElement& e) const {
  const Vector a = end_[e.vertex[0]], b = end_[e.vertex[1]], c = end_[e.vertex[2]];
  ElementBound bound = {};
  const auto set = [&bound](int k, Vector normal, Vector point) {
    bound.x[k] = static_cast<float>(normal.x);
    bound.y[k] = static_cast<float>(normal.y);
    bound.z[k] = static_cast<float>(normal.z);
    bound.offset[k] = static_cast<float>(Dot(normal, point));
  };
  if (e.surface) {
    const Vector normal = Unit(Cross(b - a, c - a));
    set(0, normal, a);
    set(1, Unit(Cross(b - a, normal)), a);
    set(2, Unit(Cross(c - b, normal)), b);
    set(3, Unit(Cross(a - c, normal)), c);
  } else {
    const Vector along = Unit(b - a);
    set(1, along, b);
    set(2, -1.0 * along, a);
  }
  return bound;
}

void FlexBoundary::Look(const float x[3], List* list) {
  for (int k = 0; k < 3; ++k) list->position[k] = x[k];
  list->fraction = fraction_;
  const size_t begin = candidates_.size();
  const int cell = Wrapped(CellOf(x[0] / cell_), CellOf(x[1] / cell_), CellOf(x[2] / cell_));
  const auto look = [&](int element) {
    const FlexElement& e = motion_->elements[element];
    if (!is_used_[element]) {
      is_used_[element] = 1;
      used_.push_back(element);
      bounds_[element] = MakeBound(e);
    }
    const double distance = std::sqrt(bounds_[element].SquaredDistance(x)) - slack_;
    if (distance < ListDistance(e)) candidates_.push_back({distance - e.radius, element});
  };
  std::for_each(in_cell_.begin() + cell_start_[cell], in_cell_.begin() + cell_start_[cell + 1], look);
  std::for_each(everywhere_.begin(), everywhere_.end(), look);
  std::sort(candidates_.begin() + begin, candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.element < b.element;
  });
  int found = static_cast<int>(candidates_.size() - begin);
  if (found > most_) {
    found = most_;
    too_many_ = true;
  }
  if (found <= list->room) {  // Overwrites the last list.
    std::copy_n(candidates_.begin() + begin, found, candidates_.begin() + list->first);
    candidates_.resize(begin);
  } else {
    list->first = static_cast<int>(begin);
    list->room = std::max(found, 2 * list->room);
    candidates_.resize(begin + list->room);
  }
  list->last = list->first + found;
}

void FlexBoundary::FindNear(const Particles& p, const int* order) {
  near_.clear();
  if (!active_) return;
  for (int i = 0; i < p.count; ++i) {
    const float* x = p.position + 4 * i;
    bool inside = true;  // False for NaN.
    for (int k = 0; k < 3; ++k) inside &= x[k] >= low_[k] && x[k] <= high_[k];
    if (!inside) continue;
    List& list = lists_[order[i]];
    double squared = 0;
    for (int k = 0; k < 3; ++k) {
      squared += (x[k] - list.position[k]) * (x[k] - list.position[k]);
    }
    double moved = std::sqrt(squared) + furthest_ * (fraction_ - list.fraction);
    if (list.fraction < 0 || moved > kSkin * fluid_.spacing) {
      Look(x, &list);
      moved = 0;
    }
    if (list.first == list.last) continue;
    Near near = {};
    near.particle = i;
    near.first = list.first;
    near.last = list.last;
    near.moved = moved;
    near_.push_back(near);
  }
}

}  // namespace softgym_mj
