// A world's picture.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_
#define SOFTGYM_MJ_RENDERING_BATCH_DRAW_H_

#include "rendering/batch/light.h"

namespace softgym_mj::pictures {
namespace {

// A ray through a sample: its direction has the length 1 along the view.
struct Ray {
  Point from, along;
  Point to_eye;  // Unit,
  Point back;    // of the middle of the image: for light, all of it is seen from there, as by OpenGL.
  float spread;  // Of what a sample shows, at the distance 1.
};

inline Ray RayOf(const Canvas& c, const Eye& eye, int x, int y) {
  const float pixel = 2 * eye.slope / static_cast<float>(c.height);
  const Point view = {pixel * (static_cast<float>(x) + 0.5f - 0.5f * static_cast<float>(c.width)),
                      pixel * (0.5f * static_cast<float>(c.height) - static_cast<float>(y) - 0.5f), -1};
  const Point along = Turned(eye.rotation, view);
  return {At(eye.position),
          along,
          Direction({-along.x, -along.y, -along.z}),
          {eye.rotation[2], eye.rotation[5], eye.rotation[8]},
          pixel};
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
    // How many texels a sample shows, along a side: from the areas of the triangle.
    const int *p = c.image + 2 * corner[0], *q = c.image + 2 * corner[1], *r = c.image + 2 * corner[2];
    const float width = static_cast<float>(texture.width), height = static_cast<float>(texture.height);
    const float texels = width * height * fabsf((u[1] - u[0]) * (v[2] - v[0]) - (v[1] - v[0]) * (u[2] - u[0]));
    const float samples = fabsf(static_cast<float>(q[0] - p[0]) * static_cast<float>(r[1] - p[1]) -
                                static_cast<float>(q[1] - p[1]) * static_cast<float>(r[0] - p[0])) /
                          65536;
    texel = Sampled(texture, at[0], at[1], sqrtf(texels / std::max(samples, 1e-3f)));
  }
  return Lit(c, s.material, texel, on.place, NormalOn(c, corner, on), ray.back);
}

inline Point SolidColor(const Canvas& c, const Solid& solid, const Hit& hit, const Ray& ray) {
  const Scene& s = *c.scene;
  const Material& material = solid.material;
  Point texel = {1, 1, 1};
  if (material.texture >= 0) {
    const Texture& texture = s.At<Texture>(s.textures)[material.texture];
    const float facing = std::max(fabsf(Dot(hit.normal, ray.to_eye)), 0.05f);
    const float side = ray.spread * hit.distance / sqrtf(facing) * 0.5f * material.repeat;
    // As MuJoCo has it: a picture covers two metres.
    const float u = 0.5f * material.repeat * (hit.at.x + solid.size[0]),
                v = 0.5f * material.repeat * (solid.size[1] - hit.at.y);
    texel = Sampled(texture, u, v, side * static_cast<float>(texture.width));
  }
  return Lit(c, material, texel, ray.from + hit.distance * ray.along, hit.normal, ray.back);
}

inline Point SkyColor(const Canvas& c, const Ray& ray) {
  const float* sky = c.scene->At<float>(c.scene->sky);
  const float at = 0.5f * (1 - ray.to_eye.z) * (kSkyRows - 1);  // The eye looks the other way.
  const int row = std::min(static_cast<int>(at), kSkyRows - 2);
  const float share = at - static_cast<float>(row);
  return (1 - share) * At(sky + 3 * row) + share * At(sky + 3 * row + 3);
}

// The nearest solid that a ray hits; -1: none.
inline int NearestSolid(const Canvas& c, const Ray& ray, Hit* nearest) {
  int found = -1;
  nearest->distance = kFar;
  for (int i = 0; i < c.scene->num_solids; ++i) {
    const Hit hit = HitSolid(c, i, ray.from, ray.along);
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

// The colour that one sample shows.
inline Point ColorAt(const Canvas& c, const Eye& eye, int x, int y) {
  const Scene& s = *c.scene;
  const Ray ray = RayOf(c, eye, x, y);
  const int at = y * c.width + x, samples = c.width * c.height;
  Hit hit;
  const int solid = NearestSolid(c, ray, &hit);
  float behind = hit.distance;
  Point color;
  const Key mesh = s.num_triangles ? c.nearest[at] : kNone;
  if (mesh != kNone && DistanceOf(mesh) < behind) {
    behind = DistanceOf(mesh);
    color = MeshColor(c, TriangleOf(mesh), ray);
  } else {
    color = solid < 0 ? SkyColor(c, ray) : SolidColor(c, s.At<Solid>(s.solids)[solid], hit, ray);
  }
  const auto over = [&](const Material& material, const Point& place, const Point& normal) {
    const Point own = Lit(c, material, {1, 1, 1}, place, normal, ray.back);
    color = material.opacity * own + (1 - material.opacity) * color;
  };
  float water = s.kind == kWater ? EnterWater(c, ray.from, ray.along, 0, behind) : behind;
  const auto over_water = [&] {
    const Point place = ray.from + water * ray.along;
    over(s.material, place, WaterNormal(c, place));
    water = kFar;
  };
  if (!(water < behind)) water = kFar;
  for (int pane = s.num_glasses ? kMostPanes : 0; pane > 0; --pane) {  // From behind.
    const Key key = c.nearest[static_cast<long long>(samples) * pane + at];
    if (key == kNone || DistanceOf(key) >= behind) continue;
    if (water < kFar && DistanceOf(key) < water) over_water();
    const int* corner = s.At<int>(s.triangles) + 3 * TriangleOf(key);
    const OnTriangle on = Meet(c, corner, ray);
    over(GlassOf(s, TriangleOf(key)).material, on.place, NormalOn(c, corner, on));
  }
  if (water < kFar) over_water();
  return color;
}

// The label and the distance of the first thing that one sample shows; the label of an object also behind glass.
inline void SurfaceAt(const Canvas& c, const Eye& eye, int x, int y, unsigned char* label, float* distance) {
  const Scene& s = *c.scene;
  const Ray ray = RayOf(c, eye, x, y);
  const int at = y * c.width + x;
  Hit hit;
  const int solid = NearestSolid(c, ray, &hit);
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
    if (s.num_triangles) DrawTriangles(c, 0, s.num_triangles, nullptr, c.nearest);
    const int panes = !s.num_glasses ? 0 : b.what == kColors ? kMostPanes : 1;
    for (int pane = 1; pane <= panes; ++pane) {
      Key* nearest = c.nearest + static_cast<long long>(samples) * pane;
      const Key* before = pane > 1 ? nearest - samples : nullptr;
      DrawTriangles(c, s.num_triangles, s.num_triangles + s.glass_triangles, before, nearest);
    }
    const long long first = (i * b.num_eyes + e) * pixels;
    Each(static_cast<int>(pixels), [&](int pixel) {
      const int x = pixel % static_cast<int>(b.width), y = pixel / static_cast<int>(b.width);
      if (b.what == kSurfaces) {
        SurfaceAt(c, eye, x, y, b.labels + first + pixel, b.distances + first + pixel);
        return;
      }
      Point sum = {0, 0, 0};
      for (int k = 0; k < c.samples * c.samples; ++k) {
        sum = sum + ColorAt(c, eye, c.samples * x + k % c.samples, c.samples * y + k / c.samples);
      }
      sum = 255.0f / static_cast<float>(c.samples * c.samples) * sum;
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
