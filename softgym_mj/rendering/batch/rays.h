// Colors of meshes, solids and the sky along rays.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_RAYS_H_
#define SOFTGYM_MJ_RENDERING_BATCH_RAYS_H_

#include "rendering/batch/light.h"

namespace softgym_mj::pictures {
namespace {

// A ray through a sample; its direction has length 1 along the view.
struct Ray {
  Point from, along;
  Point back;    // Direction to the eye at the image center, used for all specular light, as in OpenGL.
  float spread;  // Footprint of a sample at distance 1.
};

inline Ray RayOf(const Canvas& c, const Eye& eye, int x, int y) {
  const float pixel = 2 * eye.slope / static_cast<float>(c.height);
  const Point view = {pixel * (static_cast<float>(x) + 0.5f - 0.5f * static_cast<float>(c.width)),
                      pixel * (0.5f * static_cast<float>(c.height) - static_cast<float>(y) - 0.5f), -1};
  return {At(eye.position), Turned(eye.rotation, view), {eye.rotation[2], eye.rotation[5], eye.rotation[8]}, pixel};
}

// Hit of a ray and a triangle: position and barycentric coordinates.
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

// Index of the rigid mesh of a triangle.
inline int RigidOf(const Scene& s, int triangle) {
  const Rigid* rigids = s.At<Rigid>(s.rigids);
  int low = 0, high = s.num_parts + s.num_glasses - 1;
  while (low < high) {
    const int middle = (low + high + 1) / 2;
    triangle - s.num_triangles >= rigids[middle].first_triangle ? low = middle : high = middle - 1;
  }
  return low;
}

inline Point MeshColor(const Canvas& c, int triangle, const Ray& ray) {
  const Scene& s = *c.scene;
  const bool is_part = triangle >= s.num_triangles;
  const Material& material = is_part ? s.At<Rigid>(s.rigids)[RigidOf(s, triangle)].material : s.material;
  const int* corner = s.At<int>(s.triangles) + 3 * triangle;
  const OnTriangle on = Meet(c, corner, ray);
  Point texel = {1, 1, 1};
  if (!is_part && material.texture >= 0) {
    const Texture& texture = s.At<Texture>(s.textures)[material.texture];
    const float* texcoords = s.At<float>(s.texcoords);
    float u[3], v[3], at[2] = {0, 0};
    for (int k = 0; k < 3; ++k) {
      u[k] = texcoords[2 * corner[k]], v[k] = texcoords[2 * corner[k] + 1];
      at[0] += on.shares[k] * u[k], at[1] += on.shares[k] * v[k];
    }
    // Texels per pixel along a side, from the areas of the triangle.
    const int *p = c.image + 2 * corner[0], *q = c.image + 2 * corner[1], *r = c.image + 2 * corner[2];
    const float width = static_cast<float>(texture.width), height = static_cast<float>(texture.height);
    const float texels = width * height * fabsf((u[1] - u[0]) * (v[2] - v[0]) - (v[1] - v[0]) * (u[2] - u[0]));
    const float samples = fabsf(static_cast<float>(q[0] - p[0]) * static_cast<float>(r[1] - p[1]) -
                                static_cast<float>(q[1] - p[1]) * static_cast<float>(r[0] - p[0])) /
                          65536;
    texel = Sampled(texture, at[0], at[1], sqrtf(texels / std::max(samples, 1e-3f)) * static_cast<float>(c.samples));
  }
  return Lit(c, material, texel, on.place, NormalOn(c, corner, on), ray.back);
}

inline Point SolidColor(const Canvas& c, const Solid& solid, const Hit& hit, const Ray& ray) {
  const Scene& s = *c.scene;
  const Material& material = solid.material;
  Point texel = {1, 1, 1};
  if (material.texture >= 0) {
    const Texture& texture = s.At<Texture>(s.textures)[material.texture];
    const float facing = std::max(fabsf(Dot(hit.normal, Direction(ray.along))), 0.05f);
    const float side = ray.spread * hit.distance / sqrtf(facing) * 0.5f * material.repeat;
    // MuJoCo's convention: a texture covers two meters.
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

}  // namespace
}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_RAYS_H_
