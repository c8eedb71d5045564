#include "cloth/plugin/air.h"

#include <algorithm>
#include <cmath>

#include "cloth/plugin/drag.h"
#include "cloth/plugin/layers.h"

namespace softgym_mj::cloth {
void AddDrag(const Mesh& mesh, const Start& start, double timestep, std::vector<double>* acceleration) {
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const Material& material = mesh.materials[mesh.part[triangle.vertex[0]]];
    if (material.drag <= 0 || !(triangle.area > 0)) continue;
    Vector n;
    const double damped = Drag(start.position.data(), start.velocity.data(), start.acceleration.data(), triangle.vertex,
                               triangle.area, mesh.density[mesh.part[triangle.vertex[0]]], material.drag, timestep, &n);
    for (int k = 0; k < 3; ++k) {
      const int vertex = triangle.vertex[k];
      if (start.inverse_mass[vertex] == 0) continue;
      const double change = -damped / 3 * start.inverse_mass[vertex];
      (*acceleration)[3 * vertex] += change * n.x;
      (*acceleration)[3 * vertex + 1] += change * n.y;
      (*acceleration)[3 * vertex + 2] += change * n.z;
    }
  }
}

bool StartAir(const Mesh& mesh, const Start& start, const std::vector<Pair>& pairs, const Planes& planes,
              AlignedFloats* air) {
  bool takes = false;
  for (const Material& material : mesh.materials) takes |= material.added_mass > 0;
  if (!takes) return false;
  std::fill(air->begin(), air->end(), 0.0f);
  std::vector<double> area(mesh.NumVertices());
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const int* v = triangle.vertex;
    const Vector a = FromArray(&start.position[3 * v[0]]), b = FromArray(&start.position[3 * v[1]]);
    const Vector n = Cross(b - a, FromArray(&start.position[3 * v[2]]) - a);
    for (int k = 0; k < 3; ++k) {
      area[v[k]] += triangle.area / 3;
      (*air)[4 * v[k]] += static_cast<float>(n.x);
      (*air)[4 * v[k] + 1] += static_cast<float>(n.y);
      (*air)[4 * v[k] + 2] += static_cast<float>(n.z);
    }
  }
  std::vector<bool> touches(mesh.NumVertices());
  for (const Pair& pair : pairs) {
    const int* v = pair.vertex;
    if (pair.distance > (1 + kTouching) * Layers::Thickness(mesh, pair)) continue;
    for (int k = 0; k < 4; ++k) {
      if (IsAcross(pair, &(*air)[4 * v[k]])) touches[v[k]] = true;
    }
  }
  planes.MarkTouching(mesh, kTouching, &touches);
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    float* n = &(*air)[4 * v];
    const double taken = mesh.materials[mesh.part[v]].added_mass * area[v];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const bool moves = !touches[v] && start.IsFree(v) && length > 0;
    const float scale = moves ? static_cast<float>(std::sqrt(taken / (mesh.mass[v] + taken))) / length : 0;
    for (int k = 0; k < 3; ++k) n[k] *= scale;
  }
  return true;
}

}  // namespace softgym_mj::cloth
