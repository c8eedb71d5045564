#include "config.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace softgym_mj {

const char* const kAttributes[] = {
    "count",    "spacing",  "columns", "corner", "viscosity", "cohesion",  "friction",
    "density",  "substeps", "two_way", "world",  "max_speed", "draw",      "rgba",
};
const int kNumAttributes = sizeof(kAttributes) / sizeof(kAttributes[0]);

namespace {

constexpr int kMaxCount = 200000;  // A step of this many takes a tenth of a second.
constexpr int kMaxSubsteps = 1000;

// A column of L layers stays within a few per cent of its rest density when the substep is at most
// kColumnSubstep / sqrt(L) seconds; no substep is longer than kMaxSubstep. Both hold for this spacing
// and, like the times in which things fall, change with its square root.
constexpr double kColumnSubstep = 1.0 / (60.0 * 2.8);
constexpr double kMaxSubstep = 0.0025;
constexpr double kMeasuredSpacing = 0.018;

// Reads the attributes of one instance; remembers the first thing that is wrong.
class Reader {
 public:
  Reader(const mjModel* m, int instance) : m_(m), instance_(instance) {}

  const std::string& error() const { return error_; }

  // Reads `n` numbers, each in [low, high] (infinite bounds excluded); keeps the default if absent.
  template <class T>
  bool Numbers(const char* name, T* out, int n, double low, double high, bool whole = false) {
    const char* text = Text(name);
    if (!text) return false;
    double values[4];
    const char* cursor = text;
    bool good = true;
    for (int i = 0; i < n && good; ++i) {
      char* end;
      values[i] = std::strtod(cursor, &end);
      good = end != cursor && std::isfinite(values[i]) && values[i] >= low && values[i] <= high &&
             (!whole || values[i] == std::floor(values[i]));
      cursor = end;
    }
    while (good && *cursor) good = std::isspace(static_cast<unsigned char>(*cursor++));
    if (!good) {
      char valid[120];
      const char* kind = whole ? "whole number" : "number";
      if (n == 1) {
        std::snprintf(valid, sizeof(valid), "a %s in %g..%g", kind, low, high);
      } else {
        std::snprintf(valid, sizeof(valid), "%d %ss, each in %g..%g", n, kind, low, high);
      }
      Fail(name, text, valid);
      return false;
    }
    for (int i = 0; i < n; ++i) out[i] = static_cast<T>(values[i]);
    return true;
  }

  void Flag(const char* name, bool* out) {
    const char* text = Text(name);
    if (!text) return;
    if (!std::strcmp(text, "true") || !std::strcmp(text, "1")) {
      *out = true;
    } else if (!std::strcmp(text, "false") || !std::strcmp(text, "0")) {
      *out = false;
    } else {
      Fail(name, text, "true or false");
    }
  }

  void Choice(const char* name, Draw* out) {
    const char* text = Text(name);
    if (!text) return;
    constexpr const char* kNames[] = {"surface", "fine", "particles", "none"};
    for (int i = 0; i < 4; ++i) {
      if (!std::strcmp(text, kNames[i])) {
        *out = static_cast<Draw>(i);
        return;
      }
    }
    Fail(name, text, "surface, fine, particles or none");
  }

  void Fail(const char* name, const std::string& value, const std::string& valid) {
    if (error_.empty()) {
      error_ = std::string("attribute ") + name + "=\"" + value + "\" is not valid: expected " +
               valid + ".";
    }
  }

  // The text of an attribute, nullptr if it is absent or blank.
  const char* Text(const char* name) const {
    const char* text = mj_getPluginConfig(m_, instance_, name);
    if (!text) return nullptr;
    for (const char* c = text; *c; ++c) {
      if (!std::isspace(static_cast<unsigned char>(*c))) return text;
    }
    return nullptr;
  }

 private:
  const mjModel* m_;
  int instance_;
  std::string error_;
};

}  // namespace

int FluidConfig::Layers() const {
  int column = columns[0] * columns[1];
  return (count + column - 1) / column;
}

int FluidConfig::Substeps(double timestep) const {
  if (substeps) return substeps;
  double longest = std::min(kColumnSubstep / std::sqrt(static_cast<double>(Layers())), kMaxSubstep);
  longest *= std::sqrt(spacing / kMeasuredSpacing);
  return std::min(kMaxSubsteps, static_cast<int>(std::ceil(timestep / longest - 1e-9)));
}

std::string ParseConfig(const mjModel* m, int instance, FluidConfig* config) {
  FluidConfig parsed;
  Reader read(m, instance);
  bool counted = read.Numbers("count", &parsed.count, 1, 1, kMaxCount, true);
  if (!counted && read.error().empty()) {
    return "attribute count (number of particles, 1 or more) is missing.";
  }
  read.Numbers("spacing", &parsed.spacing, 1, 1e-4, 10);
  parsed.corner[2] = parsed.spacing / 2;
  int side = std::max(1, static_cast<int>(std::lround(std::cbrt(parsed.count))));
  parsed.columns[0] = parsed.columns[1] = side;
  read.Numbers("columns", parsed.columns, 2, 1, kMaxCount, true);
  read.Numbers("corner", parsed.corner, 3, -1e4, 1e4);
  read.Numbers("viscosity", &parsed.viscosity, 1, 0, 1e3);
  read.Numbers("cohesion", &parsed.cohesion, 1, 0, 1e3);
  read.Numbers("friction", &parsed.friction, 1, 0, 10);
  read.Numbers("density", &parsed.density, 1, 1e-6, 1e6);
  read.Numbers("substeps", &parsed.substeps, 1, 0, kMaxSubsteps, true);
  read.Flag("two_way", &parsed.two_way);
  read.Flag("world", &parsed.world);
  read.Numbers("max_speed", &parsed.max_speed, 1, 0.01, 1e3);
  read.Choice("draw", &parsed.draw);
  read.Numbers("rgba", parsed.rgba, 4, 0, 1);
  if (read.error().empty()) *config = parsed;
  return read.error();
}

}  // namespace softgym_mj
