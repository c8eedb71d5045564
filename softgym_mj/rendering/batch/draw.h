// A world's picture.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_
#define SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_

#include "rendering/batch/light.h"

namespace softgym_mj::pictures {
namespace {

// A ray through a sample: its direction has the length 1 along the view.
struct Ray {
  Point from, along;
  Point back;    // From the middle of the image: for light, all of it is seen from there, as by OpenGL.
  float spread;  // Of what a sample shows, at the distance 1.
};

inline Ray RayOf(const Canvas& c, const Eye& eye, int x, int y) {
  const float pixel = 2 * eye.slope / static_cast<float>(c.height);
  const Point view = {pixel * (static_cast<float>(x) + 0.5f - 0.5f * static_cast<float>(c.width)),
                      pixel * (0.5f * static_cast<float>(c.height) - static_cast<float>(y) - 0.5f), -1};
  return {At(eye.position), Turned(eye.rotation, view), {eye.rotation[2], eye.rotation[5], eye.rotation[8]}, pixel};
}

// What of a triangle a ray shows: where, and the shares of its corners.
struct OnTriangle {
  Point place;
  float shares[3];
};

inline OnTriangle Meet(const Canvas& c, const int* corner, const Ray& ray) {
  const Point a = c.places[corner[0]], ab = c.places[corner[1]] - a, ac = c.places[corner[2]] - a, from = ray.from - a;
  const Point across = Cross(ray.along, ac), other = Cross(from, ab);
  const float whole = Dot(ab, across), scale = whole != 0 ? 1 / whole : 0;
  const float u = scale * Dot(from, across), v = scale * Dot(ray.along, other), t = scale * Dot(ac, other);
  return {ray.from + t * ray.along, {1 - u - v, u, v}};
}

inline Point NormalOn(const Canvas& c, const int* corner, const OnTriangle& on) {
  Point sum = {0, 0, 0};
  for (int k = 0; k < 3; ++k) sum = sum + on.shares[k] * c.normals[corner[k]];
  return Direction(sum);
}

inline Point MeshColor(const Canvas& c, int triangle, const Ray& ray) {
  const Scene& s = *c.scene;
  const int* corner = s.At<int>(s.triangles) + 3 * triangle;
  const OnTriangle on = Meet(c, corner, ray);
  Point texel = {1, 1, 1};
  if (s.material.texture >= 0) {
    const Texture& texture = s.At<Texture>(s.textures)[s.material.texture];
    const float* texcoords = s.At<float>(s.texcoords);
    float u[3], v[3], at[2] = {0, 0};
    for (int k = 0; k < 3; ++k) {
      u[k] = texcoords[2 * corner[k]], v[k] = texcoords[2 * corner[k] + 1];
      at[0] += on.shares[k] * u[k], at[1] += on.shares[k] * v[k];
    }
    // How many texels a pixel shows, along a side: from the areas of the triangle.
    const int *p = c.image + 2 * corner[0], *q = c.image + 2 * corner[1], *r = c.image + 2 * corner[2];
    const float width = static_cast<float>(texture.width), height = static_cast<float>(texture.height);
    const float texels = width * height * fabsf((u[1] - u[0]) * (v[2] - v[0]) - (v[1] - v[0]) * (u[2] - u[0]));
    const float samples = fabsf(static_cast<float>(q[0] - p[0]) * static_cast<float>(r[1] - p[1]) -
                                static_cast<float>(q[1] - p[1]) * static_cast<float>(r[0] - p[0])) /
                          65536;
    texel = Sampled(texture, at[0], at[1], sqrtf(texels / std::max(samples, 1e-3f)) * static_cast<float>(c.samples));
  }
  return Lit(c, s.material, texel, on.place, NormalOn(c, corner, on), ray.back);
}

inline Point SolidColor(const Canvas& c, const Solid& solid, const Hit& hit, const Ray& ray) {
  const Scene& s = *c.scene;
  const Material& material = solid.material;
  Point texel = {1, 1, 1};
  if (material.texture >= 0) {
    const Texture& texture = s.At<Texture>(s.textures)[material.texture];
    const float facing = std::max(fabsf(Dot(hit.normal, Direction(ray.along))), 0.05f);
    const float side = ray.spread * hit.distance / sqrtf(facing) * 0.5f * material.repeat;
    // As MuJoCo has it: a picture covers two metres.
    const float u = 0.5f * material.repeat * (hit.at.x + solid.size[0]),
                v = 0.5f * material.repeat * (solid.size[1] - hit.at.y);
    texel = Sampled(texture, u, v, side * static_cast<float>(c.samples * texture.width));
  }
  return Lit(c, material, texel, ray.from + hit.distance * ray.along, hit.normal, ray.back);
}

inline Point SkyColor(const Canvas& c, const Ray& ray) {
  const float* sky = c.scene->At<float>(c.scene->sky);
  const float at = 0.5f * (1 + Direction(ray.along).z) * (kSkyRows - 1);
  const int row = std::min(static_cast<int>(at), kSkyRows - 2);
  const float share = at - static_cast<float>(row);
  return (1 - share) * At(sky + 3 * row) + share * At(sky + 3 * row + 3);
}

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

// Which glass a triangle belongs to.
inline const Glass& GlassOf(const Scene& s, int triangle) {
  const Glass* glasses = s.At<Glass>(s.glasses);
  int g = 0;
  while (g + 1 < s.num_glasses && triangle - s.num_triangles >= glasses[g + 1].first_triangle) ++g;
  return glasses[g];
}

// What is behind each other in a sample.
struct Seen {
  int solid;     // Of what is not translucent: its number, kMesh or kSky,
  float behind;  // its distance.
  int panes;     // How many are in front of it.
  float water;   // Where the water begins; kFar: not in front of it.

  bool IsLike(const Seen& other) const {
    return solid == other.solid && panes == other.panes && (water < kFar) == (other.water < kFar);
  }
};

constexpr int kSky = -1, kMesh = -2;
constexpr int kGlassShares = 8;  // Of a triangle of glass, of which there are large ones.

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
  const Key mesh = s.num_triangles ? c.nearest[at] : kNone;
  if (mesh != kNone && DistanceOf(mesh) < seen.behind) seen.solid = kMesh, seen.behind = DistanceOf(mesh);
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
  if (seen.solid == kMesh) {
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
    const Material& glass = GlassOf(s, TriangleOf(key)).material;
    over(glass, glass.opacity, true, on.place, NormalOn(c, corner, on));
  }
  if (water < kFar) over_water();
  return color;
}

// The colour of a pixel whose first sample is (x, y): each thing that is seen is lit once.
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
  const float object = s.kind == kWater  ? EnterWater(c, ray.from, ray.along, 0, hit.distance)
                       : s.num_triangles ? c.nearest[at] == kNone ? kFar : DistanceOf(c.nearest[at])
                                         : kFar;
  const bool is_object = object < *distance;
  if (is_object) *label = kObject, *distance = object;
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

// Draws world `i`, with the memory of a slot.
inline void DrawWorld(const Batch& b, long long i, long long slot) {
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
    const Eye& eye = s.At<Eye>(s.eyes)[e];
    Project(c, eye);
    const int samples = c.width * c.height;
    if (s.num_triangles) DrawTriangles(c, 0, s.num_triangles, 1, nullptr, c.nearest);
    const int panes = !s.num_glasses ? 0 : b.what == kColors ? kMostPanes : 1;
    for (int pane = 1; pane <= panes; ++pane) {
      Key* nearest = c.nearest + static_cast<long long>(samples) * pane;
      const Key* before = pane > 1 ? nearest - samples : nullptr;
      DrawTriangles(c, s.num_triangles, s.num_triangles + s.glass_triangles, kGlassShares, before, nearest);
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
