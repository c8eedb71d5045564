#include "cloth/plugin/air.h"

#include <algorithm>
#include <cmath>

#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kAirDensity = 1.2;  // [kg/m^3]
// Vertices whose gap is below this share of the thickness touch something: they move no air.
constexpr double kTouching = 0.1;

}  // namespace

void AddDrag(const Mesh& mesh, const Start& start, double timestep, std::vector<double>* acceleration) {
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const Material& material = mesh.materials[mesh.part[triangle.vertex[0]]];
    if (material.drag <= 0 || !(triangle.area > 0)) continue;
    Vector x[3], v = {0, 0, 0}, a = {0, 0, 0};
    for (int k = 0; k < 3; ++k) {
      x[k] = FromArray(&start.position[3 * triangle.vertex[k]]);
      v = v + (1.0 / 3) * FromArray(&start.velocity[3 * triangle.vertex[k]]);
      a = a + (1.0 / 3) * FromArray(&start.acceleration[3 * triangle.vertex[k]]);
    }
    Vector n = Cross(x[1] - x[0], x[2] - x[0]);
    const double twice = Norm(n);
    if (!(twice > 0)) continue;
    n = (1 / twice) * n;
    // Of the speed at the end of the step, so that what is light stops and does not turn round.
    const double own = mesh.density[mesh.part[triangle.vertex[0]]] * triangle.area;
    const double rate = 0.5 * kAirDensity * material.drag * triangle.area / own * std::fabs(Dot(n, v));
    const double damped = own * rate * Dot(n, v + timestep * a) / (1 + rate * timestep);
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
    if (pair.distance > (1 + kTouching) * mesh.thickness[mesh.Pair(v[0], v[3])]) continue;
    for (int k = 0; k < 4; ++k) touches[v[k]] = true;
  }
  planes.MarkTouching(mesh, kTouching, &touches);
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    float* n = &(*air)[4 * v];
    const double taken = mesh.materials[mesh.part[v]].added_mass * area[v];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const bool moves = !touches[v] && start.inverse_mass[v] > 0 && length > 0;
    const float scale = moves ? static_cast<float>(std::sqrt(taken / (mesh.mass[v] + taken))) / length : 0;
    for (int k = 0; k < 3; ++k) n[k] *= scale;
  }
  return true;
}

}  // namespace softgym_mj::cloth
