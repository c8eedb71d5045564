// Advances the particles by one step.

#ifndef SOFTGYM_MJ_FLUID_SOLVER_H_
#define SOFTGYM_MJ_FLUID_SOLVER_H_

#include <cstdint>
#include <memory>
#include <vector>

#include "boundary.h"
#include "config.h"
#include "flex_boundary.h"
#include "kernels.h"
#include "motion.h"

namespace softgym_mj {

// Sum of the impulses [N s] on a wall in a step and of their moments about the world origin
// [N m s].
struct Impulse {
  double linear[3];
  double angular[3];
};

constexpr size_t kAlignment = 64;  // [bytes] Alignment of the widest SIMD vectors.

// Speed limit [m/s] of particles, above which a wall counts as teleported: neither may move further in a substep than
// half the range of the walls.
double MaxSpeed(const FluidConfig& config, double timestep);

// Constants of a fluid with substeps of h [s].
FluidConstants MakeConstants(const FluidConfig& config, double h);

// Passes of viscosity at the end of a step, and the factor of each.
struct Smoothing {
  int passes;
  float viscosity;
};
Smoothing MakeSmoothing(const FluidConfig& config, double timestep);

// Largest viscosity [m^2/s] that a step of `timestep` seconds can follow.
double MaxViscosity(const FluidConfig& config, double timestep);

// A growing array of floats or ints for vector loads; its content does not survive growing.
template <class T>
class Buffer {
 public:
  T* Reserve(size_t size) {
    if (size > size_) {
      // Manual alignment, because not every platform has a function for it.
      const size_t more = size + size / 4;
      memory_.reset(new char[more * sizeof(T) + kAlignment]);
      size_ = more;
      const uintptr_t address = reinterpret_cast<uintptr_t>(memory_.get());
      data_ = reinterpret_cast<T*>(memory_.get() + (kAlignment - address % kAlignment));
    }
    return data_;
  }
  T* get() const { return data_; }
  size_t size() const { return size_; }

 private:
  std::unique_ptr<char[]> memory_;
  T* data_ = nullptr;
  size_t size_ = 0;
};

// Solver with scratch memory of one thread. A step is a pure function of its arguments.
class Solver {
 public:
  // Moves `count` particles (positions [m] and velocities [m/s], x y z each) by `timestep` seconds
  // while the walls move from `start` to `end`, and the flexes. Fills `impulses`, one per wall, unless
  // it is null. Returns false if neighbors, particles or flex elements, were left out because there were too many.
  bool Step(const FluidConfig& config, double timestep, const double gravity[3], const std::vector<Wall>& walls,
            const std::vector<Pose>& start, const std::vector<Pose>& end, const FlexMotion& flexes, double* positions,
            double* velocities, Impulse* impulses);

  // Mass [kg] and moment about `center` [kg m^2] of the particles that touch one of the walls
  // first..last-1 after the last step.
  void TouchingInertia(size_t first, size_t last, const double center[3], double inertia[2]);

 private:
  void Prepare(const FluidConfig& config, double h, const double* positions);
  void FindOrigin(const double* positions);
  void Load(const double* positions, const double* velocities);
  void Store(double* positions, double* velocities) const;
  void ShapeGrid();
  void Sort(float cell);
  void Separate();
  void FindPairs();
  void BuildLists(float h, int later);
  bool ListsExpired() const;
  void PlaceWalls(const std::vector<Pose>& start, const std::vector<Pose>& end, double fraction);
  void Substep(float h, int later, const double gravity[3], float max_speed, Impulse* impulses);
  void Smooth(const FluidConfig& config, double timestep, float h, Impulse* impulses);
  void DragAtWalls(float viscosity, float h, Impulse* impulses);
  void AddImpulse(const double (&sums)[6], double mass_rate, Impulse* impulse) const;

  const Kernels* kernels_ = nullptr;
  FluidConstants fluid_;
  Particles p_;
  Grid grid_;
  Neighbors neighbors_;
  int count_ = 0;
  float margin_ = 0;  // Margin of the lists [m]; 0 if they are not valid for another substep.
  bool too_many_ = false;
  double mass_;       // Mass of a particle [kg].
  double origin_[3];  // Single precision positions are relative to it.

  FlexBoundary flexes_;
  const std::vector<Wall>* walls_ = nullptr;
  std::vector<float> wall_start_, wall_end_, wall_built_;  // 12 numbers per wall, as in WallPairs.
  std::vector<WallPairs> pairs_;

  Buffer<float> position_, old_position_, velocity_, spare_, correction_, gradient_, wall_gradient_, wall_density_,
      free_share_, pressure_, x_, y_, z_, built_position_, e_, distance_, pair_numbers_, candidates_;
  Buffer<int> cell_, start_, order_, spare_order_, begin_, index_, pair_particle_, candidate_index_;
  std::vector<char> touching_;
  std::vector<int> in_cell_;
  std::vector<double> scratch_;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_SOLVER_H_
