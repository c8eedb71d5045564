// Intersection of rays with boxes, spheres and cylinders.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_SOLIDS_H_
#define SOFTGYM_MJ_RENDERING_BATCH_SOLIDS_H_

#include "rendering/batch/scene.h"

namespace softgym_mj::pictures {
namespace {

constexpr float kFar = 1e9f;

struct Hit {
  float distance;  // In lengths of the ray's direction; kFar means none.
  Point normal;    // Normal in the solid's frame.
  Point at;        // Position in that frame.
};

// Whether a ray comes near a solid; `margin`: per distance along the ray.
inline bool ComesNear(const Pose& frame, const Point& from, const Point& along, float margin = 0) {
  const Point to = frame.position - from;
  const float square = Dot(along, along), way = Dot(to, along) / square;
  const float reach = frame.reach + margin * fabsf(way);
  return way * sqrtf(square) > -reach && Dot(to, to) - way * way * square <= reach * reach;
}

// Intersects a box. `scales`: componentwise 1 / along.
inline Hit HitBox(const float* size, const Point& from, const Point& along, const Point& scales) {
  const float at[3] = {from.x, from.y, from.z}, by[3] = {along.x, along.y, along.z};
  const float scale[3] = {scales.x, scales.y, scales.z};
  float near = -kFar, far = kFar;
  int side = 0;
  for (int k = 0; k < 3; ++k) {
    const float a = (-size[k] - at[k]) * scale[k], b = (size[k] - at[k]) * scale[k], first = std::min(a, b);
    if (first > near) near = first, side = k;
    far = std::min(far, std::max(a, b));
  }
  if (near > far || near <= 0) return {kFar, {}, {}};
  const float sign = by[side] > 0 ? -1.0f : 1.0f;
  return {near, {side == 0 ? sign : 0, side == 1 ? sign : 0, side == 2 ? sign : 0}, from + near * along};
}

inline Point Inverse(const Point& a) {
  const auto inverse = [](float b) { return b != 0 ? 1 / b : kFar; };
  return {inverse(a.x), inverse(a.y), inverse(a.z)};
}

inline Hit HitSphere(const float* size, const Point& from, const Point& along) {
  const float a = Dot(along, along), b = Dot(from, along), c = Dot(from, from) - size[0] * size[0];
  const float root = b * b - a * c;
  if (root < 0) return {kFar, {}, {}};
  const float t = (-b - sqrtf(root)) / a;
  if (t <= 0) return {kFar, {}, {}};
  const Point at = from + t * along;
  return {t, 1 / size[0] * at, at};
}

inline Hit HitCylinder(const float* size, const Point& from, const Point& along) {
  Hit hit = {kFar, {}, {}};
  const float a = along.x * along.x + along.y * along.y, b = from.x * along.x + from.y * along.y,
              c = from.x * from.x + from.y * from.y - size[0] * size[0], root = b * b - a * c;
  if (a > 0 && root >= 0) {
    const float t = (-b - sqrtf(root)) / a;
    const Point at = from + t * along;
    if (t > 0 && fabsf(at.z) <= size[1]) hit = {t, {at.x / size[0], at.y / size[0], 0}, at};
  }
  if (along.z != 0) {
    const float end = along.z > 0 ? -size[1] : size[1], t = (end - from.z) / along.z;
    const Point at = from + t * along;
    if (t > 0 && t < hit.distance && at.x * at.x + at.y * at.y <= size[0] * size[0]) {
      hit = {t, {0, 0, along.z > 0 ? -1.0f : 1.0f}, at};
    }
  }
  return hit;
}

// Intersects solid `i`. `scales`: `Inverse(along)`.
inline Hit HitSolid(const Canvas& c, int i, const Point& start, const Point& along, const Point& scales) {
  const Solid& solid = c.scene->At<Solid>(c.scene->solids)[i];
  const Pose& frame = c.frames[i];
  Point from = start - frame.position, by = along;
  if (frame.is_turned) from = TurnedBack(frame.rotation, from), by = TurnedBack(frame.rotation, by);
  Hit hit = solid.shape == kBox      ? HitBox(solid.size, from, by, frame.is_turned ? Inverse(by) : scales)
            : solid.shape == kSphere ? HitSphere(solid.size, from, by)
                                     : HitCylinder(solid.size, from, by);
  if (frame.is_turned && hit.distance < kFar) hit.normal = Turned(frame.rotation, hit.normal);
  return hit;
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_SOLIDS_H_
