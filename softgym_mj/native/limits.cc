#include "limits.h"

#include <cstdio>

namespace softgym_mj {
namespace {

// [s] Substeps of a thousandth square to what a float can hold; none of these is of any use.
constexpr double kShortestStep = 1e-6, kLongestStep = 10;
// Each takes some hundred bytes, and MuJoCo a body for each vertex: some kilobytes.
constexpr mjtSize kMostFlexParts = 1 << 22;

}  // namespace

std::string CheckLimits(const mjModel* m) {
  char text[200] = "";
  if (!(m->opt.timestep >= kShortestStep && m->opt.timestep <= kLongestStep)) {
    std::snprintf(text, sizeof(text), "option timestep=\"%g\" is not valid: expected %g..%g.", m->opt.timestep,
                  kShortestStep, kLongestStep);
  }
  const struct {
    const char* name;
    mjtSize count;
  } parts[] = {{"vertices", m->nflexvert}, {"edges", m->nflexedge}, {"elements", m->nflexelem}};
  for (const auto& part : parts) {
    if (part.count <= kMostFlexParts) continue;
    std::snprintf(text, sizeof(text), "the model's flexes have %lld %s: expected at most %lld.",
                  static_cast<long long>(part.count), part.name, static_cast<long long>(kMostFlexParts));
  }
  return text;
}

}  // namespace softgym_mj
