// Lights, shadows and colors, as in OpenGL's fixed-function pipeline, but per sample.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_LIGHT_H_
#define SOFTGYM_MJ_RENDERING_BATCH_LIGHT_H_

#include "rendering/batch/meshes.h"
#include "rendering/batch/solids.h"
#include "rendering/batch/surface.h"

namespace softgym_mj::pictures {
namespace {

constexpr float kAside = 100;       // [m] Distance from the origin beyond which nothing casts a shadow.
constexpr float kOffset = 2e-3f;    // [m] Offset of shadow rays from a surface.
constexpr float kVoxelsOff = 0.5f;  // The same in voxels of the water.
constexpr float kTexelsOff = 1.5f;  // The same in texels of a shadow map.
constexpr float kShininess = 128;   // OpenGL's exponent of a material with shininess 1.

inline Point Times(const Point& a, const Point& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

// Coordinates perpendicular to a light's direction, and along it.
struct Across {
  Point right, up, to;

  explicit Across(const Light& light) : to(At(light.direction)) {
    right = Direction(Cross(fabsf(to.z) < 0.9f ? Point{0, 0, 1} : Point{1, 0, 0}, to));
    up = Cross(to, right);
  }
};

// Grid of a shadow map over all deformable objects.
struct ShadowGrid {
  float left, low, scale;  // [m], texels per meter.

  explicit ShadowGrid(const float* bounds) {
    left = kAside - bounds[1], low = kAside - bounds[3];
    const float size = std::max(bounds[0] - kAside - left, bounds[2] - kAside - low);
    scale = (kShadowSide - 4) / std::max(size, 0.05f);
    left -= 2 / scale, low -= 2 / scale;
  }
};

// Renders the shadow maps of some triangles for all lights with shadows, from map `shadow` on.
inline void DrawShadows(const Canvas& c, int first_vertex, int num_vertices, int first_triangle, int num_triangles,
                        int first_shadow) {
  const Scene& s = *c.scene;
  const Light* lights = s.At<Light>(s.lights);
  const int* triangles = s.At<int>(s.triangles) + 3 * first_triangle;
  if (!num_triangles) return;
  for (int l = 0, shadow = 0; l < s.num_lights && shadow < kMostShadows; ++l) {
    if (!lights[l].has_shadow) continue;
    float* bounds = c.bounds + 4 * (first_shadow + shadow);
    float* heights = c.shadows + kShadowTexels * (first_shadow + shadow);
    ++shadow;
    const Across across(lights[l]);
    Each(4, [&](int i) { bounds[i] = 0; });
    Each(kShadowTexels, [&](int i) { heights[i] = 0; });
    Each(num_vertices, [&](int i) {
      const Point& p = c.places[first_vertex + i];
      const float x = Dot(across.right, p), y = Dot(across.up, p);
      if (!(fabsf(x) < kAside && fabsf(y) < kAside)) return;
      TakeLargest(&bounds[0], kAside + x), TakeLargest(&bounds[1], kAside - x);
      TakeLargest(&bounds[2], kAside + y), TakeLargest(&bounds[3], kAside - y);
    });
    const ShadowGrid grid(bounds);
    Each(num_triangles, [&](int t) {
      int corners[3][2];
      float values[3];
      for (int k = 0; k < 3; ++k) {
        const Point& p = c.places[triangles[3 * t + k]];
        const float x = Dot(across.right, p), y = Dot(across.up, p), height = Dot(across.to, p);
        if (!(fabsf(x) < kAside && fabsf(y) < kAside && fabsf(height) < kAside)) return;
        corners[k][0] = static_cast<int>(256 * grid.scale * (x - grid.left));
        corners[k][1] = -static_cast<int>(256 * grid.scale * (y - grid.low)) + 256 * kShadowSide;
        values[k] = kAside + height;
      }
      EachSample(corners, values, kShadowSide, kShadowSide, 0, 1, [&](int x, int y, float height) {
        TakeLargest(&heights[(kShadowSide - 1 - y) * kShadowSide + x], height);
      });
    });
  }
}

inline void DrawShadows(const Canvas& c) {
  const Scene& s = *c.scene;
  DrawShadows(c, 0, s.num_vertices, 0, s.num_triangles, 0);
  DrawShadows(c, s.num_vertices, s.part_vertices, s.num_triangles, s.part_triangles, kMostShadows);
}

// Share of a light that a shadow map lets through to a point.
inline float Passes(const Canvas& c, const Across& across, int map, const Point& place, const Point& normal) {
  const ShadowGrid grid(c.bounds + 4 * map);
  const float* heights = c.shadows + kShadowTexels * map;
  const Point p = place + std::max(kOffset, kTexelsOff / grid.scale) * normal;
  const float x = grid.scale * (Dot(across.right, p) - grid.left) - 0.5f,
              y = grid.scale * (Dot(across.up, p) - grid.low) - 0.5f, height = kAside + Dot(across.to, p);
  if (!(x >= 0 && y >= 0 && x < kShadowSide - 1 && y < kShadowSide - 1)) return 1;
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const float u = x - static_cast<float>(i), v = y - static_cast<float>(j);
  float share = 0;
  for (int k = 0; k < 4; ++k) {
    const bool is_lit = heights[(j + k / 2) * kShadowSide + i + k % 2] <= height;
    share += (k % 2 ? u : 1 - u) * (k / 2 ? v : 1 - v) * (is_lit ? 1.0f : 0.0f);
  }
  return share;
}

// Share of a light that reaches a point; `shadow`: index of its shadow map.
inline float Reaches(const Canvas& c, const Light& light, int shadow, const Point& place, const Point& normal) {
  const Scene& s = *c.scene;
  const Across across(light);
  const Point off = place + kOffset * normal;
  const Point scales = Inverse(across.to);
  for (int i = 0; i < s.num_solids; ++i) {
    if (ComesNear(c.frames[i], off, across.to) && HitSolid(c, i, off, across.to, scales).distance < kFar) return 0;
  }
  if (s.kind == kWater) {
    const Point above = place + kVoxelsOff * c.voxel * normal;
    if (EnterWater(c, above, across.to, 0, kAside) < kAside) return 0;
  }
  if (shadow >= kMostShadows) return 1;
  float share = s.num_triangles ? Passes(c, across, shadow, place, normal) : 1;
  if (s.part_triangles && share > 0) share *= Passes(c, across, kMostShadows + shadow, place, normal);
  return share;
}

// Color of a texture; `texels`: texels of the first mipmap level per pixel, along a side.
inline Point Sampled(const Texture& texture, float u, float v, float texels) {
  const unsigned char* data = reinterpret_cast<const unsigned char*>(texture.texels);
  int width = texture.width, height = texture.height;
  for (int level = 1; level < texture.levels && texels > 1.5f; ++level, texels *= 0.5f) {
    data += 4 * width * height;
    width = width > 1 ? width / 2 : 1, height = height > 1 ? height / 2 : 1;
  }
  const float x = (u - floorf(u)) * static_cast<float>(width) - 0.5f,
              y = (v - floorf(v)) * static_cast<float>(height) - 0.5f;
  const float fx = floorf(x), fy = floorf(y);
  Point sum = {0, 0, 0};
  for (int k = 0; k < 4; ++k) {
    const int i = (static_cast<int>(fx) + k % 2 + width) % width, j = (static_cast<int>(fy) + k / 2 + height) % height;
    const unsigned char* texel = data + 4 * (j * width + i);
    const float share = (k % 2 ? x - fx : 1 - (x - fx)) * (k / 2 ? y - fy : 1 - (y - fy));
    const Point color = {static_cast<float>(texel[0]), static_cast<float>(texel[1]), static_cast<float>(texel[2])};
    sum = sum + share / 255 * color;
  }
  return sum;
}

// Light from a surface to the eye. `texel`: color factor, white without a texture. Glass receives no shadows.
inline Point Lit(const Canvas& c, const Material& material, const Point& texel, const Point& place, const Point& normal,
                 const Point& to_eye, bool is_glass = false) {
  const Scene& s = *c.scene;
  const Light* lights = s.At<Light>(s.lights);
  const float facing = Dot(normal, to_eye);
  Point sum = At(s.ambient) + std::max(facing, 0.0f) * At(s.headlight), shine = {0, 0, 0};
  for (int l = 0, shadow = 0; l < s.num_lights; ++l) {
    const Light& light = lights[l];
    const Point to = At(light.direction);
    const int own = shadow;
    shadow += light.has_shadow;
    sum = sum + At(light.ambient);
    const float cosine = Dot(normal, to);
    if (cosine <= 0) continue;
    const float share = light.has_shadow && !is_glass ? Reaches(c, light, own, place, normal) : 1.0f;
    if (share <= 0) continue;
    sum = sum + share * cosine * At(light.diffuse);
    const float half = Dot(normal, Direction(to + to_eye)), n = kShininess * material.shininess;
    // Schlick's (1994) approximation of half^n, which is bit-identical on all processors.
    if (half > 0) shine = shine + share * material.specular * half / (n - n * half + half) * At(light.specular);
  }
  const Point all = Times(Times(sum, At(material.color)) + shine, texel);
  return {std::min(all.x, 1.0f), std::min(all.y, 1.0f), std::min(all.z, 1.0f)};
}

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_LIGHT_H_
