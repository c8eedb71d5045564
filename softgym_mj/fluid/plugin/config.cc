#include "config.h"

#include <algorithm>
#include <cmath>

#include "native/attributes.h"

namespace softgym_mj {

const char* const kAttributes[] = {
    "count",    "spacing", "columns", "corner", "viscosity", "cohesion", "friction", "density",
    "substeps", "two_way", "world",   "flexes", "max_speed", "draw",     "rgba",
};
const int kNumAttributes = sizeof(kAttributes) / sizeof(kAttributes[0]);

namespace {

constexpr int kMaxCount = 200000;  // A step of this many particles takes 0.1 s.
constexpr int kMaxSubsteps = 1000;

// A column of L layers stays within a few per cent of its rest density when the substep is at most
// kColumnSubstep / sqrt(L) seconds; no substep is longer than kMaxSubstep. Both hold for this spacing
// and, like times of fall, scale with its square root.
constexpr double kColumnSubstep = 1.0 / (60.0 * 2.8);
constexpr double kMaxSubstep = 0.0025;
constexpr double kMeasuredSpacing = 0.018;

}  // namespace

std::int64_t FluidConfig::Columns() const { return std::int64_t{columns[0]} * columns[1]; }

int FluidConfig::Layers() const { return static_cast<int>((count + Columns() - 1) / Columns()); }

int FluidConfig::Substeps(double timestep) const {
  if (substeps) return substeps;
  double longest = std::min(kColumnSubstep / std::sqrt(static_cast<double>(Layers())), kMaxSubstep);
  longest *= std::sqrt(spacing / kMeasuredSpacing);
  return static_cast<int>(std::clamp(std::ceil(timestep / longest - 1e-9), 1.0, double{kMaxSubsteps}));
}

// A lattice of the rest spacing, filled from below, with random offsets of up to a thousandth of the spacing, which
// prevent an unstable equilibrium.
void FluidConfig::PlaceLattice(double* positions) const {
  const std::int64_t num_columns = Columns();
  unsigned random = 12345;
  for (int i = 0; i < count; ++i) {
    const int column = static_cast<int>(i % num_columns), layer = static_cast<int>(i / num_columns);
    const int site[3] = {column % columns[0], column / columns[0], layer};
    for (int k = 0; k < 3; ++k) {
      random = random * 1664525u + 1013904223u;
      const double noise = (random >> 8) / 16777216.0 - 0.5;
      positions[3 * i + k] = corner[k] + spacing * (site[k] + 0.002 * noise);
    }
  }
}

std::string ParseConfig(const mjModel* m, int instance, FluidConfig* config) {
  FluidConfig parsed;
  AttributeReader read(m, instance);
  bool counted = read.Numbers("count", &parsed.count, 1, 1, kMaxCount);
  if (!counted && read.error().empty()) {
    return "attribute count (number of particles, 1 or more) is missing.";
  }
  read.Numbers("spacing", &parsed.spacing, 1, 1e-4, 10);
  parsed.corner[2] = parsed.spacing / 2;
  int side = std::max(1, static_cast<int>(std::lround(std::cbrt(parsed.count))));
  parsed.columns[0] = parsed.columns[1] = side;
  read.Numbers("columns", parsed.columns, 2, 1, kMaxCount);
  read.Numbers("corner", parsed.corner, 3, -1e4, 1e4);
  read.Numbers("viscosity", &parsed.viscosity, 1, 0, 1e3);
  read.Numbers("cohesion", &parsed.cohesion, 1, 0, 1e3);
  read.Numbers("friction", &parsed.friction, 1, 0, 10);
  read.Numbers("density", &parsed.density, 1, 1e-6, 1e6);
  read.Numbers("substeps", &parsed.substeps, 1, 0, kMaxSubsteps);
  read.Flag("two_way", &parsed.two_way);
  read.Flag("world", &parsed.world);
  read.Flag("flexes", &parsed.flexes);
  read.Numbers("max_speed", &parsed.max_speed, 1, 0.01, 1e3);
  int draw = static_cast<int>(parsed.draw);
  read.Choice("draw", {"surface", "fine", "particles", "none"}, &draw);
  parsed.draw = static_cast<Draw>(draw);
  read.Numbers("rgba", parsed.rgba, 4, 0, 1);
  if (read.error().empty()) *config = parsed;
  return read.error();
}

}  // namespace softgym_mj
