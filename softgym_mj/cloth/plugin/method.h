// Numbers of the method, wherever it is carried out.

#ifndef SOFTGYM_MJ_CLOTH_METHOD_H_
#define SOFTGYM_MJ_CLOTH_METHOD_H_

#include <cstdint>

namespace softgym_mj::cloth {

// A vertex' reference position follows when it is further away than this [m]; slower ones count as standing still.
// Without it the normals of a pile jitter, and it never comes to rest.
constexpr double kHysteresis = 5e-4;
constexpr float kInterest = 1.3f;  // Pairs further apart than this many thicknesses are left out.
// Boxes get this share of the reach more, so that candidates can be kept for some steps of slow motion.
constexpr float kSlack = 0.25f;
constexpr float kSearchMargin = 0.65f;  // Share of the thickness by which vertices may end elsewhere than was searched.
constexpr int kMaxSearches = 4;
constexpr int kRopePasses = 4;           // Of ropes that impact zones have pulled at, and of these zones, alternating.
constexpr int kRopeSolves = 2;           // Newton's steps of each: 0.4 of an edge leaves 0.015 of it.
constexpr double kPlaneMargin = 0.02;    // [m] Vertices that are further than this and two steps cannot reach a plane.
constexpr double kSolidMargin = 0.002;   // [m] Beyond what can come near to a solid in a step.
constexpr double kVelocityMargin = 0.2;  // [m/s] By which bodies may be faster at the end of a step than at its start.
// Substeps after which the nearest points of triangles to solids are found anew, if nothing moves further in them [m].
constexpr int kSearchInterval = 5;
constexpr double kSearchWay = 0.01;

// The same, if the fastest vertex moves as far as this in a step [m].
inline int SearchInterval(double fastest, int substeps) {
  return fastest * kSearchInterval > substeps * kSearchWay ? 1 : kSearchInterval;
}

// A row's place among others: of its vertices alone. As the finalizer of MurmurHash3 by Appleby, which is in the
// public domain.
inline std::uint32_t RowHash(const int* vertex, int corners) {
  std::uint32_t h = 0;
  for (int k = 0; k < corners; ++k) {
    h = h * 31 + static_cast<std::uint32_t>(vertex[k]);
    h ^= h >> 16;
    h *= 0x85ebca6bu;
    h ^= h >> 13;
    h *= 0xc2b2ae35u;
    h ^= h >> 16;
  }
  return h;
}

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_METHOD_H_
