// Scenes of the batch renderer, and memory of images.
//
// A scene is one block of memory: `Scene`, then arrays at offsets in bytes. rendering/batch/scenes.py writes it.

#ifndef SOFTGYM_MJ_RENDERING_BATCH_SCENE_H_
#define SOFTGYM_MJ_RENDERING_BATCH_SCENE_H_

#include "batch/group.h"
#include "batch/memory.h"
#include "native/kernel_shape.h"
#include "native/tube.h"
#include "native/vec.h"

namespace softgym_mj::pictures {

using Point = Vec3<float>;

enum Kind { kNothing, kSheet, kRope, kWater };      // Kinds of deformable objects.
enum Shape { kBox, kSphere, kCylinder };            // Shapes of solids.
enum Label { kBackground, kObject, kActor, kCup };  // LABELS of rendering/observables.py.
enum What { kColors, kSurfaces };                   // Output: colors, or labels and depths.

constexpr int kSkyRows = 32;     // Colors of the sky, from straight down to straight up.
constexpr int kMostSamples = 4;  // Largest number of samples per pixel.
constexpr int kMostPanes = 6;    // Largest number of visible layers of glass.
constexpr int kShadowSide = 256, kShadowTexels = kShadowSide * kShadowSide;
constexpr int kMostShadows = 3;  // Largest number of lights with shadows.
// Grid of water: blocks of voxels around the origin, as many as fit into the memory.
constexpr int kBlockSide = 8, kVoxels = kBlockSide * kBlockSide * kBlockSide;
constexpr int kBlocksX = 32, kBlocksZ = 16, kBlocks = kBlocksX * kBlocksX * kBlocksZ, kMostBlocks = 2048;
constexpr int kBuckets = 4096;  // Hash buckets of particles by cell.

struct Material {
  float color[3], opacity, specular, shininess;
  int texture;   // -1 means none.
  float repeat;  // Repetitions of the texture in two meters.
};

struct Solid {
  int shape, mover, label;  // `mover`: index of a mover, or -1 if fixed.
  float size[3], position[3], rotation[9];
  Material material;
};

// Triangle mesh on a mover: opaque (a part) or glass.
struct Rigid {
  int mover, label, first_vertex, num_vertices, first_triangle, num_triangles;
  Material material;
};

struct Light {
  float direction[3], diffuse[3], ambient[3], specular[3];  // `direction` points to the light.
  int has_shadow;
};

struct Eye {
  int mover;                              // That it moves with, or -1 if fixed.
  float position[3], rotation[9], slope;  // `slope`: of the upper edge of the image.
};

struct Texture {
  unsigned long long texels;  // Address of RGBX texels; each mipmap level follows the next larger one.
  int width, height, levels, unused;
};

struct Scene {
  int kind, num_points, num_vertices, num_triangles;  // The deformable object.
  int num_parts, part_vertices, part_triangles;       // Opaque rigid meshes, then those of glass.
  int num_glasses, glass_vertices, glass_triangles;
  int num_solids, num_lights, num_eyes;
  int sides, rings_per_edge;  // Rope only.
  int most_triangles;         // Limit of an equivalent mesh of the water surface, beyond which voxels grow.
  float inflate, radius, spacing, voxel;
  float ambient[3], headlight[3];
  Material material;  // The deformable object.
  int rigids, solids, lights, eyes, textures, sky;
  // Of vertices: weights of points, triangles around it; of triangles: vertices; those of rigid meshes follow.
  int weight_starts, weight_points, weights, around_starts, around, triangles, texcoords, rigid_places, rigid_normals;
  int circle, quarter;  // Cosines and sines of a rope's sides and caps.

  template <class T>
  const T* At(int offset) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(this) + offset);
  }
};

// Batch of images. Each array has a row per environment.
struct Batch {
  long long num_envs, num_slots, most_points, num_movers, num_eyes, height, width, samples, what, memory_size;
  const char* const* scenes;  // (num_envs,) Scenes; environments with null are not rendered.
  char* memory;               // (num_slots, memory_size)
  const double* points;       // (num_envs, most_points, 3)
  const double* poses;        // (num_envs, num_movers, 7) positions and quaternions
  int* begun;                 // Number of environments begun on a GPU.
  const int* order;           // (num_envs,) Their order.
  long long* cost;            // (num_envs,) GPU cycles of the last images.
  unsigned char* colors;      // (num_envs, num_eyes, height, width, 3)
  float* distances;           // (num_envs, num_eyes, height, width)
  unsigned char* labels;      // likewise
};

// Pose of a mover or a solid, and bounding radius of the latter.
struct Pose {
  Point position;
  float rotation[9], reach;
  bool is_turned;
};

// Memory for the images of one environment.
struct Canvas {
  const Scene* scene;
  const double *points, *poses;
  int width, height, samples;  // Size of an image in samples, and samples along a side of a pixel.
  // Vertices of the deformable object, then of rigid meshes: positions, normals, image points [1/256 of a sample] and
  // 1 / distance.
  Point *places, *normals;
  int* image;
  float* nearness;
  Pose* frames;  // Poses of solids.
  // Nearest triangles in each sample, distance and index: opaque ones, then layers of glass.
  Key* nearest;
  // Shadow maps (kMostShadows, kShadowTexels) of the deformable object, then of parts, if there are any, and bounds
  // (kMostShadows, 4) of what casts them, perpendicular to the light.
  float *shadows, *bounds;
  Ring* rings;
  Vector *surface, *out;
  // Water: particles by buckets; positions in voxels, cells and kernels in this order.
  int *bucket_starts, *bucket_ends, *in_buckets;
  Vector* centers;
  unsigned long long* cells;
  KernelShape* kernels;
  // Index of each block, or -1; list of blocks with water, and last their number; weights in these blocks [kUnit];
  // cells with water at a corner, as bits, and their number.
  int *blocks, *wet, *weights, *crossed, *num_crossed;
  int* low_block;  // (3,) Lowest block with water,
  int* high_block;
  int* partial;
  float voxel;
};

inline Point At(const float* a) { return {a[0], a[1], a[2]}; }
inline Point At(const double* a) {
  return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
}
inline Point At(const Vector& a) { return At(&a.x); }
using softgym_mj::Dot;
inline float Dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Point Direction(const Point& a) {
  const float length = sqrtf(Dot(a, a));
  return length > 0 ? 1 / length * a : Point{0, 0, 1};
}
// Multiplies by a row-major matrix, and by its transpose.
inline Point Turned(const float* m, const Point& a) {
  return {m[0] * a.x + m[1] * a.y + m[2] * a.z, m[3] * a.x + m[4] * a.y + m[5] * a.z,
          m[6] * a.x + m[7] * a.y + m[8] * a.z};
}
inline Point TurnedBack(const float* m, const Point& a) {
  return {m[0] * a.x + m[3] * a.y + m[6] * a.z, m[1] * a.x + m[4] * a.y + m[7] * a.z,
          m[2] * a.x + m[5] * a.y + m[8] * a.z};
}

inline Pose PoseOf(const Canvas& c, int mover) {
  if (mover < 0) return {{0, 0, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, 0, false};
  const double* p = c.poses + 7 * mover;
  const float w = static_cast<float>(p[3]), x = static_cast<float>(p[4]), y = static_cast<float>(p[5]),
              z = static_cast<float>(p[6]);
  return {
      At(p),
      {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
       2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
      0,
      true};
}

// An eye in the world.
inline Eye Placed(const Canvas& c, const Eye& eye) {
  if (eye.mover < 0) return eye;
  const Pose pose = PoseOf(c, eye.mover);
  const Point position = pose.position + Turned(pose.rotation, At(eye.position));
  Eye placed = {-1, {position.x, position.y, position.z}, {}, eye.slope};
  for (int k = 0; k < 9; ++k) {
    for (int n = 0; n < 3; ++n) placed.rotation[k] += pose.rotation[k / 3 * 3 + n] * eye.rotation[3 * n + k % 3];
  }
  return placed;
}

inline int NumOpaque(const Scene& s) { return s.num_triangles + s.part_triangles; }
inline int NumVertices(const Scene& s) { return s.num_vertices + s.part_vertices + s.glass_vertices; }

inline int CapRings(const Scene& s) { return s.sides / 4 > 2 ? s.sides / 4 : 2; }
inline int TubeRings(const Scene& s) { return (s.num_points - 1) * s.rings_per_edge + 1 + 2 * CapRings(s); }

// Allocates a canvas for images of (height, width) pixels.
inline void TakeCanvas(const Scene& s, long long height, long long width, long long samples, Memory* memory,
                       Canvas* c) {
  const long long vertices = NumVertices(s), maps = kMostShadows * (s.num_parts ? 2 : 1),
                  pixels = height * width * samples * samples;
  c->width = static_cast<int>(width * samples), c->height = static_cast<int>(height * samples);
  c->samples = static_cast<int>(samples);
  memory->Take(&c->places, vertices);
  memory->Take(&c->normals, vertices);
  memory->Take(&c->image, 2 * vertices);
  memory->Take(&c->nearness, vertices);
  memory->Take(&c->frames, s.num_solids);
  memory->Take(&c->nearest, pixels * (1 + (s.num_glasses ? kMostPanes : 0)));
  memory->Take(&c->shadows, maps * kShadowTexels);
  memory->Take(&c->bounds, maps * 4);
  memory->Take(&c->partial, kMostThreads);
  if (s.kind == kRope) {
    memory->Take(&c->rings, TubeRings(s));
    memory->Take(&c->surface, s.num_vertices);
    memory->Take(&c->out, s.num_vertices);
  }
  if (s.kind == kWater) {
    memory->Take(&c->bucket_starts, kBuckets + 1);
    memory->Take(&c->bucket_ends, kBuckets);
    memory->Take(&c->in_buckets, s.num_points);
    memory->Take(&c->centers, s.num_points);
    memory->Take(&c->cells, s.num_points);
    memory->Take(&c->kernels, s.num_points);
    memory->Take(&c->blocks, kBlocks);
    memory->Take(&c->wet, kMostBlocks + 1);
    memory->Take(&c->weights, static_cast<long long>(kMostBlocks) * kVoxels);
    memory->Take(&c->crossed, kMostBlocks * kVoxels / 32);
    memory->Take(&c->num_crossed, kMostBlocks);
    memory->Take(&c->low_block, 3);
    memory->Take(&c->high_block, 3);
  }
}

// Reinterprets the bits as another type.
template <class To, class From>
inline To Reread(From from) {
  union {
    From from;
    To to;
  } both = {from};
  return both.to;
}

constexpr Key kNone = ~0ull;
inline float DistanceOf(Key key) { return Reread<float>(static_cast<unsigned>(key >> 32)); }
inline int TriangleOf(Key key) { return static_cast<int>(key & 0xffffffffu); }

}  // namespace softgym_mj::pictures

#endif  // SOFTGYM_MJ_RENDERING_BATCH_SCENE_H_
