#include "limits.h"

#include <cstdio>

namespace softgym_mj {
namespace {

// [s] The square of a thousandth of these must be representable as a float; useful time steps are far within.
constexpr double kShortestStep = 1e-6, kLongestStep = 10;
// Each part takes some hundred bytes, and MuJoCo's body of each vertex some kilobytes.
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
