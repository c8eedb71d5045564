// Parsed and checked attributes of the fluid plugin.

#ifndef SOFTGYM_MJ_FLUID_CONFIG_H_
#define SOFTGYM_MJ_FLUID_CONFIG_H_

#include <cstdint>
#include <string>

#include <mujoco/mujoco.h>

namespace softgym_mj {

enum class Draw { kSurface, kFine, kParticles, kNone };

// Attributes as in README.md; SI units.
struct FluidConfig {
  int count = 0;
  double spacing = 0.018;
  int columns[2] = {0, 0};  // 0: near a cube.
  double corner[3] = {0, 0, 0.009};
  double viscosity = 2e-4;
  double cohesion = 0;
  double friction = 0.01;
  double density = 1000;
  int substeps = 0;  // 0: from the number of layers.
  bool two_way = false;
  bool world = true;
  bool flexes = false;
  double max_speed = 10;
  Draw draw = Draw::kSurface;
  float rgba[4] = {0.16f, 0.5f, 0.78f, 1.0f};

  std::int64_t Columns() const;  // Number of columns of the lattice.
  int Layers() const;
  // Substeps of a step of `timestep` seconds.
  int Substeps(double timestep) const;
  // Positions (count, 3) [m] at the start.
  void PlaceLattice(double* positions) const;
};

// Names of the attributes, as registered.
extern const char* const kAttributes[];
extern const int kNumAttributes;

// Parses the attributes of a plugin instance. Returns "" or an error.
std::string ParseConfig(const mjModel* m, int instance, FluidConfig* config);

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CONFIG_H_
