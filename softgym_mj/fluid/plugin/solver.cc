#include "solver.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "fluid/plugin/pushes.h"
#include "native/instructions.h"
#include "native/simd.h"

namespace softgym_mj {
namespace {

constexpr float kSupport = 1.83f;  // Kernel radius in spacings, as in FleX.

// Calibrated on columns at rest: kernel sum in water at rest, and the contribution of a wall.
constexpr float kRestDensity = 0.632f;
constexpr float kWallDensity = 24.3f;

constexpr float kRelaxation = 0.45f;  // Above 0.6 the fluid boils.
constexpr float kCorrection = 0.4f;   // Largest correction in a substep, in spacings.
constexpr float kContact = 0.3f;      // Distance at which walls are hard, in spacings.

// Converts a sum of velocity differences to a Laplacian: sum over the neighbors of (1 - r/H)^3 r^2 / 6 in units of H^2,
// which is 4 pi (H/d)^3 times the integral of (1 - q)^3 q^4, over 6.
constexpr double kLaplacian = 4 * 3.14159265358979 * kSupport * kSupport * kSupport / 280 / 6;
constexpr double kViscosityPass = 0.7;  // Largest stable factor in one pass.
constexpr int kMaxPasses = 64;

// [m] The origin is the mean of the positions, or their median if a particle is further from the mean than this, which
// would reduce the precision of the others. Particles are kept within kFurthest of it.
constexpr double kStray = 100;

// Position relative to `origin` and rotation matrix at a fraction of the way between two poses.
void Interpolate(const Pose& a, const Pose& b, double fraction, const double origin[3], float out[12]) {
  double position[3], quaternion[4];
  double sign = mju_dot(a.quaternion, b.quaternion, 4) < 0 ? -1 : 1;
  for (int k = 0; k < 3; ++k) {
    position[k] = a.position[k] + fraction * (b.position[k] - a.position[k]);
  }
  for (int k = 0; k < 4; ++k) {
    quaternion[k] = a.quaternion[k] + fraction * (sign * b.quaternion[k] - a.quaternion[k]);
  }
  mju_normalize4(quaternion);
  mjtNum matrix[9];
  mju_quat2Mat(matrix, quaternion);
  for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(position[k] - origin[k]);
  for (int k = 0; k < 9; ++k) out[3 + k] = static_cast<float>(matrix[k]);
}

const Kernels& ChooseKernels() {
#ifdef SOFTGYM_MJ_X86
  if (UseAvx2()) return kAvx2Kernels;
#endif
  return kPortableKernels;
}

}  // namespace

FluidConstants MakeConstants(const FluidConfig& config, double h) {
  const float spacing = static_cast<float>(config.spacing);
  return {spacing,
          kSupport * spacing,
          kRestDensity,
          kWallDensity,
          kRelaxation,
          kCorrection * spacing,
          kContact * spacing,
          static_cast<float>(config.cohesion * h * h),
          static_cast<float>(config.friction)};
}

Smoothing MakeSmoothing(const FluidConfig& config, double timestep) {
  const float radius = kSupport * static_cast<float>(config.spacing);
  const double total = config.viscosity * timestep / (kLaplacian * radius * radius);
  if (total == 0) return {0, 0};
  const int passes = static_cast<int>(std::clamp(std::ceil(total / kViscosityPass), 1.0, double{kMaxPasses}));
  return {passes, static_cast<float>(std::min(total / passes, kViscosityPass))};
}

void Solver::Prepare(const FluidConfig& config, double h, const double* positions) {
  kernels_ = &ChooseKernels();
  fluid_ = MakeConstants(config, h);
  mass_ = config.density * config.spacing * config.spacing * config.spacing;
  count_ = config.count;
  margin_ = 0;
  too_many_ = false;
  neighbors_.too_many = &too_many_;
  FindOrigin(positions);
  const size_t n = static_cast<size_t>(count_) + kLanes;
  p_.count = count_;
  p_.position = position_.Reserve(4 * n);
  p_.old_position = old_position_.Reserve(4 * n);
  p_.velocity = velocity_.Reserve(4 * n);
  p_.correction = correction_.Reserve(4 * n);
  p_.gradient = gradient_.Reserve(4 * n);
  p_.wall_gradient = wall_gradient_.Reserve(4 * n);
  p_.wall_density = wall_density_.Reserve(n);
  p_.free_share = free_share_.Reserve(n);
  p_.pressure = pressure_.Reserve(n);
  p_.x = x_.Reserve(n);
  p_.y = y_.Reserve(n);
  p_.z = z_.Reserve(n);
  for (float* a : {x_.get(), y_.get(), z_.get()}) std::fill(a + count_, a + n, kFar);
  spare_.Reserve(4 * n);
  built_position_.Reserve(4 * n);
  distance_.Reserve(n);
  cell_.Reserve(n);
  order_.Reserve(n);
  spare_order_.Reserve(n);
  neighbors_.begin = begin_.Reserve(n);
  neighbors_.end = neighbors_.begin + 1;
  const size_t room = n + kLanes;
  float* x = candidates_.Reserve(3 * room);
  neighbors_.candidates = {x, x + room, x + 2 * room, candidate_index_.Reserve(room)};
  p_.pressure[count_] = 0;
}

void Solver::FindOrigin(const double* positions) {
  for (int k = 0; k < 3; ++k) {
    double furthest = 0;
    origin_[k] = std::round(SumInShares<double>(count_, [&](int i) { return positions[3 * i + k]; }) / count_);
    for (int i = 0; i < count_; ++i) {
      furthest = std::max(furthest, std::fabs(positions[3 * i + k] - origin_[k]));
    }
    if (furthest <= kStray) continue;
    scratch_.resize(count_);
    for (int i = 0; i < count_; ++i) scratch_[i] = positions[3 * i + k];
    const auto median = scratch_.begin() + count_ / 2;
    std::nth_element(scratch_.begin(), median, scratch_.end());
    origin_[k] = std::round(*median);
  }
}

void Solver::Load(const double* positions, const double* velocities) {
  for (int i = 0; i < count_; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double x = positions[3 * i + k] - origin_[k];
      p_.position[4 * i + k] = static_cast<float>(std::clamp(x, -kFurthest, kFurthest));
      p_.velocity[4 * i + k] = static_cast<float>(velocities[3 * i + k]);
    }
    p_.position[4 * i + 3] = p_.velocity[4 * i + 3] = 0;
    order_.get()[i] = i;
  }
  for (int k = 0; k < 4; ++k) {
    const int dummy = 4 * count_ + k;
    p_.position[dummy] = p_.old_position[dummy] = kFar;
    p_.velocity[dummy] = p_.correction[dummy] = 0;
  }
}

void Solver::Store(double* positions, double* velocities) const {
  for (int i = 0; i < count_; ++i) {
    const int target = 3 * order_.get()[i];
    for (int k = 0; k < 3; ++k) {
      positions[target + k] = origin_[k] + p_.position[4 * i + k];
      velocities[target + k] = p_.velocity[4 * i + k];
    }
  }
}

void Solver::PlaceWalls(const std::vector<Pose>& start, const std::vector<Pose>& end, double fraction) {
  for (size_t w = 0; w < walls_->size(); ++w) {
    Interpolate(start[w], end[w], fraction, origin_, &wall_end_[12 * w]);
  }
}

void Solver::AddImpulse(const double (&sums)[6], double mass_rate, Impulse* impulse) const {
  double linear[3], moment[3];
  for (int k = 0; k < 3; ++k) linear[k] = mass_rate * sums[k];
  mju_cross(moment, origin_, linear);
  for (int k = 0; k < 3; ++k) {
    impulse->linear[k] += linear[k];
    impulse->angular[k] += mass_rate * sums[3 + k] + moment[k];
  }
}

void Solver::Substep(float h, int later, const double gravity[3], float max_speed, Impulse* impulses) {
  const float fall[3] = {static_cast<float>(gravity[0]) * h, static_cast<float>(gravity[1]) * h,
                         static_cast<float>(gravity[2]) * h};
  std::memcpy(p_.old_position, p_.position, 4 * sizeof(float) * count_);
  for (int i = 0; i < count_; ++i) Fall(p_, i, fall, max_speed, h);
  if (ListsExpired()) BuildLists(h, later);

  std::fill(p_.wall_gradient, p_.wall_gradient + 4 * (count_ + 1), 0.0f);
  std::fill(p_.free_share, p_.free_share + count_ + 1, 1.0f);
  flexes_.FindNear(p_, order_.get());
  flexes_.FindShares(p_);
  for (const WallPairs& pairs : pairs_) kernels_->FindWallShare(fluid_, p_, pairs);
  flexes_.MultiplyFreeShare(p_);
  for (const WallPairs& pairs : pairs_) kernels_->AddWallGradient(p_, pairs);
  flexes_.AddGradient(p_);
  for (int i = 0; i < count_; ++i) {
    p_.wall_density[i] = fluid_.rest_density * (1.0f - p_.free_share[i]);
  }
  bool crowded = false;
  p_.crowded = &crowded;
  kernels_->FindPressure(fluid_, p_, neighbors_);
  if (crowded) Separate();
  kernels_->AddCorrection(fluid_, p_, neighbors_);
  flexes_.Collide(p_, fluid_.relaxation * fluid_.rest_density * fluid_.radius / 3.0f);
  for (size_t w = 0; w < pairs_.size(); ++w) {
    double sums[6] = {};
    kernels_->Collide(fluid_, p_, pairs_[w], impulses ? sums : nullptr);
    if (impulses) AddImpulse(sums, mass_ / h, impulses + w);
  }
  flexes_.Guard(p_);
  std::fill(p_.correction + 4 * count_, p_.correction + 4 * count_ + 4, 0.0f);
  const float rate = 1.0f / h;
  for (int i = 0; i < 4 * count_; ++i) {
    p_.position[i] += p_.correction[i];
    p_.velocity[i] += rate * p_.correction[i];
  }
}

// Applies viscosity, once per step.
void Solver::Smooth(const FluidConfig& config, double timestep, float h, Impulse* impulses) {
  const auto [passes, viscosity] = MakeSmoothing(config, timestep);
  if (passes == 0) return;
  // The lists are those of the last substep: pairs that have come into range since have no weight.
  flexes_.FindNear(p_, order_.get());
  flexes_.FindShares(p_);
  for (int pass = 0; pass < passes; ++pass) {
    kernels_->Smooth(fluid_, p_, neighbors_, viscosity);
    for (int i = 0; i < 4 * count_; ++i) p_.velocity[i] += p_.correction[i];
    DragAtWalls(viscosity, h, impulses);
    flexes_.Drag(p_, viscosity, h);
  }
}

// Water behind a wall moves with it and drags the water before it.
void Solver::DragAtWalls(float viscosity, float h, Impulse* impulses) {
  for (size_t w = 0; w < pairs_.size(); ++w) {
    const WallPairs& pairs = pairs_[w];
    double sums[6] = {};
    kernels_->FindWallShare(fluid_, p_, pairs);
    // Velocity in the last substep: v + omega x (position - wall position).
    float velocity[3], omega[3];
    WallVelocity(pairs.start, pairs.end, h, velocity, omega);
    for (int n = 0; n < pairs.count; ++n) {
      const int i = pairs.particle[n];
      if (i == count_) continue;
      const float share = viscosity * fluid_.rest_density * pairs.share[n];
      double change[3], terms[6];
      if (!DragAtWall(p_, i, pairs.end, velocity, omega, share, change)) continue;
      DragTerms(p_, i, change, terms);
      for (int k = 0; k < 6; ++k) sums[k] -= terms[k];
    }
    if (impulses) AddImpulse(sums, mass_, impulses + w);
  }
}

bool Solver::Step(const FluidConfig& config, double timestep, const double gravity[3], const std::vector<Wall>& walls,
                  const std::vector<Pose>& start, const std::vector<Pose>& end, const FlexMotion& flexes,
                  double* positions, double* velocities, Impulse* impulses) {
  const int substeps = config.Substeps(timestep);
  const float h = static_cast<float>(timestep / substeps);
  Prepare(config, h, positions);
  Load(positions, velocities);
  ShapeGrid();
  walls_ = &walls;
  wall_end_.resize(12 * walls.size());
  pairs_.resize(walls.size());
  if (impulses) std::fill(impulses, impulses + walls.size(), Impulse());
  const float max_speed = static_cast<float>(MaxSpeed(config, timestep));
  PlaceWalls(start, end, 0);
  flexes_.Begin(flexes, origin_, fluid_, p_, h * max_speed, substeps);
  for (int s = 0; s < substeps; ++s) {
    wall_start_ = wall_end_;
    const double fraction = static_cast<double>(s + 1) / substeps;
    PlaceWalls(start, end, fraction);
    flexes_.Place(fraction);
    Substep(h, substeps - 1 - s, gravity, max_speed, impulses);
  }
  Smooth(config, timestep, h, impulses);
  Store(positions, velocities);
  return !too_many_ && !flexes_.too_many();
}

double MaxViscosity(const FluidConfig& config, double timestep) {
  const double radius = kSupport * config.spacing;
  return kMaxPasses * kViscosityPass * kLaplacian * radius * radius / timestep;
}

double MaxSpeed(const FluidConfig& config, double timestep) {
  const double h = timestep / config.Substeps(timestep);
  return std::min(config.max_speed, 0.5 * kSupport * config.spacing / h);
}

void Solver::TouchingInertia(size_t first, size_t last, const double center[3], double inertia[2]) {
  touching_.assign(count_ + 1, 0);
  for (size_t w = first; w < last; ++w) {
    kernels_->FindDistance(pairs_[w], p_.position, distance_.get());
    for (int k = 0; k < pairs_[w].count; ++k) {
      const int i = pairs_[w].particle[k];
      if (i == count_ || touching_[i] || distance_.get()[k] > kLayer * fluid_.spacing) continue;
      touching_[i] = 1;
      double squared = 0;
      for (int a = 0; a < 3; ++a) {
        const double r = origin_[a] + p_.position[4 * i + a] - center[a];
        squared += r * r;
      }
      inertia[0] += mass_;
      inertia[1] += mass_ * squared;
    }
  }
}

}  // namespace softgym_mj
