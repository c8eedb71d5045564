#include "cloth/plugin/springs.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "cloth/plugin/coloring.h"
#include "cloth/plugin/edges.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

// Substeps between solutions of bending, if its rows are soft enough that one sweep then solves them.
constexpr int kBendInterval = 5;
constexpr double kSoft = 5;

// One sweep leaves edges of a surface too long, because later rows move their ends, as if a spring of
// 1 / (kUndone w h^2) were in series with each (fitted to strips under load). The stiffness is corrected for this, up
// to a limit: stiffness * w h^2 above 0.6 cannot be reached.
constexpr double kUndone = 1.3;
double SweptStiffness(double stiffness, double inverse_mass, double h) {
  return stiffness / (1 - std::min(kUndone * stiffness * inverse_mass * h * h, kMostGivenBack));
}

// Sets a lane to the constants of an edge of which the stiffness grows.
void SetStiffening(const Mesh& mesh, const Mesh::Edge& edge, double inverse_mass, double h, int lane,
                   StiffeningBlock* block) {
  const Material& material = mesh.materials[mesh.part[edge.vertex[0]]];
  const double stiffness = EdgeStiffness(mesh, edge), full = FullStiffness(mesh, edge);
  const bool diagonal = stiffness < full;
  block->stiffness[lane] = static_cast<float>(stiffness * h * h);
  block->growth[lane] = static_cast<float>(diagonal ? 0 : material.stiffening / edge.length);
  block->mass[lane] = static_cast<float>(inverse_mass);
  block->damping[lane] = static_cast<float>(material.stretch_damping * full * h);
}

double HingeMass(const Mesh::Hinge& hinge, const std::vector<double>& mass) {
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    if (hinge.vertex[k] >= 0) sum += hinge.weight[k] * hinge.weight[k] / mass[hinge.vertex[k]];
  }
  return sum;
}

}  // namespace

Compliance Comply(double stiffness, double damping, double h) {
  const double b = 1 / (1 + damping / h);
  return {b, b / (std::max(stiffness, 1e-12) * h * h)};
}

void AddForceIfHeld(const Points& points, int vertex, const float way[3], double force, std::vector<double>* forces) {
  if (!(points.now[4 * vertex + 3] > 0)) AddForce(way, force, &(*forces)[3 * vertex]);
}

void EdgeRows::Reset(const Mesh& mesh, double h) {
  const int dummy = mesh.NumVertices();
  Coloring coloring;
  const std::vector<std::uint8_t> counts(dummy + 1, 1);
  std::vector<int> ids, vertices;
  for (size_t e = 0; e < mesh.edges.size(); ++e) {
    if (mesh.edges[e].triangle[0] < 0) continue;
    ids.push_back(static_cast<int>(e));
    vertices.insert(vertices.end(), mesh.edges[e].vertex, mesh.edges[e].vertex + 2);
  }
  coloring.Order(vertices.data(), static_cast<int>(ids.size()), 2, counts.data(), dummy + 1, &order_);
  for (int& i : order_) i = i < 0 ? -1 : ids[i];
  blocks_.resize(order_.size() / kBlock);
  const bool stiffens = std::any_of(mesh.materials.begin(), mesh.materials.end(),
                                    [](const Material& material) { return material.stiffening > 0; });
  stiffening_.assign(stiffens ? blocks_.size() : 0, StiffeningBlock{});
  for (size_t i = 0; i < order_.size(); ++i) {
    EdgeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock, e = order_[i];
    block.vertex[0][lane] = block.vertex[1][lane] = dummy;
    block.start[0][lane] = block.length[lane] = block.before[lane] = block.gamma[lane] = 1;
    block.start[1][lane] = block.start[2][lane] = block.keep[lane] = block.impulse[lane] = 0;
    if (stiffens) stiffening_[i / kBlock].stiffness[lane] = 1;
    if (e < 0) continue;
    const Mesh::Edge& edge = mesh.edges[e];
    // Diagonals are softer, but their dashpots are as strong.
    const double inverse_mass = (1 / mesh.mass[edge.vertex[0]] + 1 / mesh.mass[edge.vertex[1]]) / 2;
    const double stiffness = SweptStiffness(EdgeStiffness(mesh, edge), inverse_mass, h);
    const double full = FullStiffness(mesh, edge);
    const double damping = mesh.materials[mesh.part[edge.vertex[0]]].stretch_damping * full / stiffness;
    const Compliance row = Comply(stiffness, damping, h);
    for (int k = 0; k < 2; ++k) block.vertex[k][lane] = edge.vertex[k];
    block.length[lane] = static_cast<float>(edge.length);
    block.gamma[lane] = static_cast<float>(row.gamma);
    block.keep[lane] = static_cast<float>(1 - row.b);
    if (stiffens) SetStiffening(mesh, edge, inverse_mass, h, lane, &stiffening_[i / kBlock]);
  }
}

void EdgeRows::Start(const cloth::Start& start, const double* after) {
  held_.clear();
  for (size_t i = 0; i < order_.size(); ++i) {
    if (order_[i] < 0) continue;
    EdgeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock, a = block.vertex[0][lane], b = block.vertex[1][lane];
    float way[3];
    block.before[lane] = StartWay(start.position.data(), a, b, way) - static_cast<float>(after[order_[i]]);
    for (int k = 0; k < 3; ++k) block.start[k][lane] = way[k];
    if (start.IsFree(a) && start.IsFree(b)) continue;
    held_.push_back(static_cast<int>(i));
  }
}

void EdgeRows::Sweep(const ClothKernels& kernels, const Points& points) {
  kernels.SweepEdges(points, blocks_.data(), stiffening_.empty() ? nullptr : stiffening_.data(),
                     static_cast<int>(blocks_.size()));
}

void EdgeRows::AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const {
  for (int i : held_) {
    const EdgeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock, a = block.vertex[0][lane], b = block.vertex[1][lane];
    float way[3];
    for (int k = 0; k < 3; ++k) way[k] = block.start[k][lane] + (points.now[4 * a + k] - points.now[4 * b + k]);
    AddForceIfHeld(points, a, way, share * block.impulse[lane], forces);
    AddForceIfHeld(points, b, way, -share * block.impulse[lane], forces);
  }
}

void EdgeRows::Keep(const Points& points, double* after) const {
  for (size_t i = 0; i < order_.size(); ++i) {
    if (order_[i] < 0) continue;
    const EdgeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock;
    const float way[3] = {block.start[0][lane], block.start[1][lane], block.start[2][lane]};
    after[order_[i]] = LengthNow(points, block.vertex[0][lane], block.vertex[1][lane], way) - block.before[lane];
  }
}

void HingeRows::Reset(const Mesh& mesh, double h) {
  const int dummy = mesh.NumVertices();
  interval_ = kBendInterval;
  std::vector<int> vertices;
  for (const Mesh::Hinge& hinge : mesh.hinges) {
    const Compliance row = Comply(hinge.stiffness, hinge.damping, kBendInterval * h);
    if (row.gamma < kSoft * HingeMass(hinge, mesh.mass)) interval_ = 1;
    for (int v : hinge.vertex) vertices.push_back(v < 0 ? dummy : v);
  }
  Coloring coloring;
  std::vector<std::uint8_t> counts(dummy + 1, 1);
  counts[dummy] = 0;
  coloring.Order(vertices.data(), static_cast<int>(mesh.hinges.size()), 4, counts.data(), dummy + 1, &order_);
  blocks_.resize(order_.size() / kBlock);
  for (size_t i = 0; i < order_.size(); ++i) {
    HingeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock, id = order_[i];
    block.gamma[lane] = 1;
    block.keep[lane] = 0;
    for (int k = 0; k < 3; ++k) block.start[k][lane] = block.before[k][lane] = 0;
    for (int k = 0; k < 4; ++k) block.vertex[k][lane] = dummy, block.weight[k][lane] = 0;
    if (id < 0) continue;
    const Mesh::Hinge& hinge = mesh.hinges[id];
    const Compliance row = Comply(hinge.stiffness, hinge.damping, interval_ * h);
    block.gamma[lane] = static_cast<float>(row.gamma);
    block.keep[lane] = static_cast<float>(1 - row.b);
    for (int k = 0; k < 4; ++k) {
      block.vertex[k][lane] = hinge.vertex[k] < 0 ? dummy : hinge.vertex[k];
      block.weight[k][lane] = static_cast<float>(hinge.weight[k]);
    }
  }
}

void HingeRows::Start(const std::vector<double>& position) {
  for (size_t i = 0; i < order_.size(); ++i) {
    if (order_[i] < 0) continue;
    HingeBlock& block = blocks_[i / kBlock];
    const int lane = i % kBlock;
    for (int k = 0; k < 3; ++k) {
      double sum = 0;
      for (int c = 0; c < 4; ++c) {
        const size_t v = block.vertex[c][lane];
        if (3 * v < position.size()) sum += block.weight[c][lane] * position[3 * v + k];
      }
      block.start[k][lane] = block.before[k][lane] = static_cast<float>(sum);
    }
  }
}

void HingeRows::Bend(const ClothKernels& kernels, const Points& points, int substep) {
  if (substep % interval_ != 0 || blocks_.empty()) return;
  kernels.Bend(points, blocks_.data(), static_cast<int>(blocks_.size()), static_cast<float>(interval_));
}

}  // namespace softgym_mj::cloth
