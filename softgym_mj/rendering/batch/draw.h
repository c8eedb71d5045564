// An environment's picture.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_
#define SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_

#include "rendering/batch/rays.h"

namespace softgym_mj::pictures {
namespace {

// Which solids may be seen in a pixel, as bits.
inline unsigned SolidsIn(const Canvas& c, const Eye& eye, int x, int y) {
  const Ray ray = RayOf(c, eye, x, y);
  const float margin = 2 * ray.spread * static_cast<float>(c.samples);
  unsigned found = 0;
  for (int i = 0; i < c.scene->num_solids; ++i) {
    if (ComesNear(c.frames[i], ray.from, ray.along, margin)) found |= 1u << i;
  }
  return found;
}

// The nearest solid of some that a ray hits; -1: none.
inline int NearestSolid(const Canvas& c, const Ray& ray, unsigned solids, Hit* nearest) {
  const Point scales = Inverse(ray.along);
  int found = -1;
  nearest->distance = kFar;
  for (; solids; solids &= solids - 1) {
    const int i = FirstBit(solids);
    const Hit hit = HitSolid(c, i, ray.from, ray.along, scales);
    if (hit.distance < nearest->distance) *nearest = hit, found = i;
  }
  return found;
}

// What is behind each other in a sample.
struct Seen {
  int solid;     // Of what is not translucent: its number, kMesh, less for parts, or kSky,
  float behind;  // its distance.
  int panes;     // How many are in front of it.
  float water;   // Where the water begins; kFar: not in front of it.

  bool IsLike(const Seen& other) const {
    return solid == other.solid && panes == other.panes && (water < kFar) == (other.water < kFar);
  }
};

constexpr int kSky = -1, kMesh = -2;
constexpr int kGlassShares = 8, kPartShares = 2;  // Of triangles of rigid meshes, of which there are large ones.

// What the first sample of a pixel has found out about water for the others, which are less than a voxel away.
struct Ahead {
  bool is_known, is_near;
  float from;  // Where to begin to look for it.
};

inline Seen SeenAt(const Canvas& c, const Ray& ray, int x, int y, unsigned solids, Ahead* ahead) {
  const Scene& s = *c.scene;
  const int at = y * c.width + x, samples = c.width * c.height;
  Hit hit;
  Seen seen = {NearestSolid(c, ray, solids, &hit), 0, 0, kFar};
  seen.behind = hit.distance;
  const Key mesh = NumOpaque(s) ? c.nearest[at] : kNone;
  if (mesh != kNone && DistanceOf(mesh) < seen.behind) {
    const int triangle = TriangleOf(mesh);
    seen.solid = triangle < s.num_triangles ? kMesh : kMesh - 1 - RigidOf(s, triangle);
    seen.behind = DistanceOf(mesh);
  }
  for (int pane = 1; s.num_glasses && pane <= kMostPanes; ++pane) {
    const Key key = c.nearest[static_cast<long long>(samples) * pane + at];
    if (key == kNone || DistanceOf(key) >= seen.behind) break;
    seen.panes = pane;
  }
  if (s.kind == kWater) {
    constexpr float kBefore = 1;  // [voxels]
    const bool looks = !ahead->is_known || ahead->is_near;
    const float water =
        looks ? EnterWater(c, ray.from, ray.along, ahead->from, seen.behind, &ahead->is_near) : seen.behind;
    if (water < seen.behind) seen.water = water;
    if (!ahead->is_known && water < seen.behind) {
      ahead->from = std::max(water - kBefore * c.voxel / sqrtf(Dot(ray.along, ray.along)), 0.0f);
    }
    ahead->is_known = true;
  }
  return seen;
}

inline Point ColorOf(const Canvas& c, const Ray& ray, int x, int y, const Seen& seen) {
  const Scene& s = *c.scene;
  const int at = y * c.width + x, samples = c.width * c.height;
  Point color;
  if (seen.solid <= kMesh) {
    color = MeshColor(c, TriangleOf(c.nearest[at]), ray);
  } else if (seen.solid == kSky) {
    color = SkyColor(c, ray);
  } else {
    color = SolidColor(c, s.At<Solid>(s.solids)[seen.solid],
                       HitSolid(c, seen.solid, ray.from, ray.along, Inverse(ray.along)), ray);
  }
  const auto over = [&](const Material& material, float opacity, bool is_glass, const Point& place,
                        const Point& normal) {
    const Point own = Lit(c, material, {1, 1, 1}, place, normal, ray.back, is_glass);
    color = opacity * own + (1 - opacity) * color;
  };
  float water = seen.water;
  const auto over_water = [&] {
    const Point place = ray.from + water * ray.along, normal = WaterNormal(c, place);
    const float through = 1 - s.material.opacity;
    over(s.material, 1 - through * through, false, place, normal);  // It has a rear side as well.
    water = kFar;
  };
  for (int pane = seen.panes; pane > 0; --pane) {  // From behind.
    const Key key = c.nearest[static_cast<long long>(samples) * pane + at];
    if (water < kFar && DistanceOf(key) < water) over_water();
    const int* corner = s.At<int>(s.triangles) + 3 * TriangleOf(key);
    const OnTriangle on = Meet(c, corner, ray);
    const Material& glass = s.At<Rigid>(s.rigids)[RigidOf(s, TriangleOf(key))].material;
    over(glass, glass.opacity, true, on.place, NormalOn(c, corner, on));
  }
  if (water < kFar) over_water();
  return color;
}

// The color of a pixel whose first sample is (x, y): each thing that is seen is lit once.
inline Point ColorAt(const Canvas& c, const Eye& eye, int x, int y) {
  const int count = c.samples * c.samples;
  const unsigned solids = SolidsIn(c, eye, x, y);
  Seen seen[kMostSamples];
  Ahead ahead = {false, false, 0};
  for (int k = 0; k < count; ++k) {
    const int i = x + k % c.samples, j = y + k / c.samples;
    seen[k] = SeenAt(c, RayOf(c, eye, i, j), i, j, solids, &ahead);
  }
  Point sum = {0, 0, 0};
  unsigned left = (1u << count) - 1;
  while (left) {
    const int first = FirstBit(left);
    int alike = 0;
    for (int k = first; k < count; ++k) {
      if (left >> k & 1 && seen[k].IsLike(seen[first])) ++alike, left &= ~(1u << k);
    }
    const int i = x + first % c.samples, j = y + first / c.samples;
    sum = sum +
          static_cast<float>(alike) / static_cast<float>(count) * ColorOf(c, RayOf(c, eye, i, j), i, j, seen[first]);
  }
  return sum;
}

// The label and the distance of the first thing that one sample shows; the label of an object also behind glass.
inline void SurfaceAt(const Canvas& c, const Eye& eye, int x, int y, unsigned char* label, float* distance) {
  const Scene& s = *c.scene;
  const Ray ray = RayOf(c, eye, x, y);
  const int at = y * c.width + x;
  Hit hit;
  const int solid = NearestSolid(c, ray, SolidsIn(c, eye, x, y), &hit);
  *label = static_cast<unsigned char>(solid < 0 ? kBackground : s.At<Solid>(s.solids)[solid].label);
  *distance = hit.distance;
  const Key mesh = NumOpaque(s) ? c.nearest[at] : kNone;
  bool is_object = false;
  if (mesh != kNone && DistanceOf(mesh) < *distance) {
    const int triangle = TriangleOf(mesh);
    is_object = triangle < s.num_triangles;
    const int shown = is_object ? kObject : s.At<Rigid>(s.rigids)[RigidOf(s, triangle)].label;
    *label = static_cast<unsigned char>(shown), *distance = DistanceOf(mesh);
  }
  const float water = s.kind == kWater ? EnterWater(c, ray.from, ray.along, 0, *distance) : kFar;
  if (water < *distance) is_object = true, *label = kObject, *distance = water;
  if (!s.num_glasses) return;
  const Key pane = c.nearest[c.width * c.height + at];
  if (pane == kNone || DistanceOf(pane) >= *distance) return;
  *distance = DistanceOf(pane);
  if (!is_object) *label = kCup;
}

// Pixel number i of an image, tile by tile: what a warp draws lies together.
inline int InTiles(int i, int width, int height) {
  constexpr int kWide = 8, kHigh = 4;
  if (width % kWide || height % kHigh) return i;
  const int tile = i / (kWide * kHigh), at = i % (kWide * kHigh), across = width / kWide;
  return (tile / across * kHigh + at / kWide) * width + tile % across * kWide + at % kWide;
}

// Draws environment `i`, with the memory of a slot.
inline void DrawEnvironment(const Batch& b, long long i, long long slot) {
  if (!b.scenes[i]) return;
  SGM_SHARED Canvas c;
  Once([&] {
    c.scene = reinterpret_cast<const Scene*>(b.scenes[i]);
    c.points = b.points + 3 * b.most_points * i;
    c.poses = b.poses + 7 * b.num_movers * i;
    c.voxel = c.scene->voxel;
    Memory memory(b.memory + b.memory_size * slot);
    TakeCanvas(*c.scene, b.height, b.width, b.samples, &memory, &c);
  });
  const Scene& s = *c.scene;
  PlaceMeshes(c);
  if (s.kind == kWater) PlaceWater(&c);
  if (b.what == kColors) DrawShadows(c);
  const long long pixels = b.height * b.width;
  for (int e = 0; e < s.num_eyes; ++e) {
    const Eye eye = Placed(c, s.At<Eye>(s.eyes)[e]);
    Project(c, eye);
    const int samples = c.width * c.height;
    if (NumOpaque(s)) Clear(c, c.nearest);
    DrawTriangles(c, 0, s.num_triangles, 1, nullptr, c.nearest);
    DrawTriangles(c, s.num_triangles, NumOpaque(s), kPartShares, nullptr, c.nearest);
    const int panes = !s.num_glasses ? 0 : b.what == kColors ? kMostPanes : 1;
    for (int pane = 1; pane <= panes; ++pane) {
      Key* nearest = c.nearest + static_cast<long long>(samples) * pane;
      const Key* before = pane > 1 ? nearest - samples : nullptr;
      Clear(c, nearest);
      DrawTriangles(c, NumOpaque(s), NumOpaque(s) + s.glass_triangles, kGlassShares, before, nearest);
    }
    const long long first = (i * b.num_eyes + e) * pixels;
    Each(static_cast<int>(pixels), [&](int i) {
      const int pixel = InTiles(i, static_cast<int>(b.width), static_cast<int>(b.height));
      const int x = pixel % static_cast<int>(b.width), y = pixel / static_cast<int>(b.width);
      if (b.what == kSurfaces) {
        SurfaceAt(c, eye, x, y, b.labels + first + pixel, b.distances + first + pixel);
        return;
      }
      const Point sum = 255.0f * ColorAt(c, eye, c.samples * x, c.samples * y);
      unsigned char* color = b.colors + 3 * (first + pixel);
      color[0] = static_cast<unsigned char>(sum.x + 0.5f);
      color[1] = static_cast<unsigned char>(sum.y + 0.5f);
      color[2] = static_cast<unsigned char>(sum.z + 0.5f);
    });
  }
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_
