// Constants of the method, shared by CPU and GPU code.

#ifndef SOFTGYM_MJ_CLOTH_METHOD_H_
#define SOFTGYM_MJ_CLOTH_METHOD_H_

#include <cstdint>

// A GPU's program without solids and bodies that give way is shorter: its instructions take less time to read. So is
// one without meshes and heightfields.
#ifndef SGM_SOLIDS
#define SGM_SOLIDS 1
#endif
#ifndef SGM_GRIDS
#define SGM_GRIDS SGM_SOLIDS
#endif

namespace softgym_mj::cloth {

constexpr bool kSolids = SGM_SOLIDS;  // False if nothing but grippers touches the flex.
constexpr bool kGrids = SGM_GRIDS;    // False if no mesh and no heightfield touches the flex.
// [m] The reference position of a vertex follows only if it is further away than this; other vertices count as at rest.
// Without this hysteresis the normals of a pile jitter and it never comes to rest.
constexpr double kHysteresis = 5e-4;
constexpr float kInterest = 1.3f;  // Pairs further apart than this many thicknesses are left out.
// Relative enlargement of boxes beyond the reach, so that candidates stay valid for some steps of slow motion.
constexpr float kSlack = 0.25f;
// Share of the thickness by which the end of a step may deviate from the searched motion.
constexpr float kSearchMargin = 0.65f;
constexpr int kMaxSearches = 4;
constexpr int kRopePasses = 4;           // Largest number of alternations of impact zones and ropes.
constexpr int kRopeSolves = 2;           // Newton steps per alternation: an error of 0.4 edge lengths becomes 0.015.
constexpr float kNoPlane = 1e3f;         // [m] Gap of vertices that no plane touches.
constexpr double kPlaneMargin = 0.02;    // [m] Vertices this much beyond two steps of motion cannot reach a plane.
constexpr double kSolidMargin = 0.002;   // [m] Added to the distance that can be covered in a step.
constexpr double kVelocityMargin = 0.2;  // [m/s] Largest increase of a body's speed within a step.
// [1/kg] A body of lower compliance, such as a picker, counts as kinematic: flexes do not push it.
constexpr double kYields = 1e-3;
constexpr double kLight = 5;  // [kg] Contacts of lighter bodies need a warm start from substep to substep.
// Warm start: share of its last impulse with which a contact near a light body starts a substep. It transmits the
// body's weight through layers to the floor.
constexpr float kWarm = 0.9f;
// Bodies of this bounding radius [m] count as small: pads of grippers.
constexpr double kSmall = 0.05;
// [m] Thickness of cloth against small bodies, so that a gripper pad fits between floor and cloth.
constexpr double kThin = 0.002;
// [m] Distance of fixed contact points on triangles against small bodies: the nearest point of a triangle would jump
// between the ends of a flat pad.
constexpr double kPointDistance = 0.0075;
// [m] Cloth that moves further in a step has fixed contact points against all solids: a triangle stopped only at its
// nearest point keeps rotating about it, in particular at thin solids.
constexpr double kHasty = 0.1;
constexpr int kMostPoints = 16;  // Largest number of fixed points along an edge.
// [m] Distance from a small body within which points store their entry face: they may be inside in the next step.
constexpr float kRemembered = 5e-4f;
constexpr int kFaces = 8;       // Number of face codes in a stored number, which is never 0.
constexpr int kNumSides = 256;  // Stored numbers.
// Largest share of the stiffness of an edge that is made up for one sweep: its row leaves it too long, because later
// rows move its ends.
constexpr double kMostGivenBack = 0.8;
// Pairs with a gap above this share of the thickness exert no force yet.
constexpr float kNotYet = 0.01f;
constexpr int kLifts = 3;  // Largest number of searches for solids along motion changed by impact zones.
// Substeps between searches for the nearest points of triangles to solids, if nothing moves further than kSearchWay [m]
// in them.
constexpr int kSearchInterval = 5;
constexpr double kSearchWay = 0.01;

// Substeps between searches if the fastest vertex moves by `fastest` [m] in a step.
inline int SearchInterval(double fastest, int substeps) {
  return fastest * kSearchInterval > substeps * kSearchWay ? 1 : kSearchInterval;
}

// Hash of a row's vertices, which determines its order; the finalizer of MurmurHash3 by Appleby (public domain).
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
