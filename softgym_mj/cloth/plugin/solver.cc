#include "cloth/plugin/solver.h"

#include <algorithm>
#include <cmath>

#include "native/vec.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kRecovery = 1;  // [m/s] At which overlaps are left at most.
// A vertex' reference position follows when it is further away than this [m]; slower ones count as standing still.
// Without it the normals of a heap jitter, and it never comes to rest.
constexpr double kHysteresis = 5e-4;
// Bending is solved every so many substeps, if its rows are then so much softer than their vertices are light that one
// sweep solves them.
constexpr int kBendInterval = 5;
constexpr double kSoft = 5;
constexpr double kAirDensity = 1.2;  // [kg/m^3]
// Vertices further from a plane than they move in two steps and this [m] cannot reach it in a step.
constexpr double kPlaneMargin = 0.02;
constexpr float kVouched = 0.65f;  // Share of the thickness by which vertices may end elsewhere than was searched.
constexpr int kMaxSearches = 4;
constexpr double kPressed = 1e-3;  // [m] By which vertices may be pressed into a plane.
// Planes are so much stiffer than other contacts: they come last, so that nothing undoes what they do.
constexpr float kFirm = 5;
// Vertices whose gap is below this share of the thickness touch something: they move no air.
constexpr double kTouching = 0.1;
// Substeps after which the nearest points of triangles to solids are found anew, if nothing moves further in them [m].
constexpr int kSearchInterval = 5;
constexpr double kSearchWay = 0.01;
// Share of its impulses that a contact near a light body starts a substep with. Decisive: what is between them and the
// floor has to learn of their weight.
constexpr float kWarm = 0.9f;

// b and b / (k h^2) of a row, see kernels.h.
struct Compliance {
  double b, gamma;
};
Compliance Comply(double stiffness, double damping, double h) {
  const double b = 1 / (1 + damping / h);
  return {b, b / (std::max(stiffness, 1e-12) * h * h)};
}

// One sweep leaves edges of a surface longer, by what the turns of others move their ends by: as if a spring of
// 1 / (kUndone w h^2) were in line with each, found for strips under load. What this takes is given back, as far as
// that goes: stiffness * w h^2 above 0.6 cannot be had.
constexpr double kUndone = 1.3, kMostGivenBack = 0.8;
double SweptStiffness(double stiffness, double inverse_mass, double h) {
  return stiffness / (1 - std::min(kUndone * stiffness * inverse_mass * h * h, kMostGivenBack));
}

double HingeMass(const Mesh::Hinge& hinge, const std::vector<double>& mass) {
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    if (hinge.vertex[k] >= 0) sum += hinge.weight[k] * hinge.weight[k] / mass[hinge.vertex[k]];
  }
  return sum;
}

}  // namespace

void Solver::Reset(const Mesh& mesh, const Settings& settings, double timestep) {
  kernels_ = &ChooseClothKernels();
  settings_ = settings;
  timestep_ = timestep;
  h_ = timestep / settings.substeps;
  const Compliance contact = Comply(settings.contact_stiffness, settings.contact_damping, h_);
  contact_ = {static_cast<float>(contact.gamma), static_cast<float>(contact.b), static_cast<float>(kRecovery * h_)};
  plane_row_ = contact_;
  plane_row_.gamma /= kFirm;
  const int count = mesh.NumVertices(), dummy = count;
  const int padded = (count + 1 + kBlock - 1) / kBlock * kBlock;
  for (AlignedFloats* a : {&now_, &before_, &drift_, &bent_drift_, &predicted_, &moved_, &air_})
    a->assign(4 * padded, 0);
  points_ = {padded,        now_.data(), before_.data(), drift_.data(), bent_drift_.data(), predicted_.data(),
             moved_.data(), air_.data()};

  Levels levels;
  const std::vector<std::uint8_t> counts(count + 1, 1);
  std::vector<int> ids, vertices;
  for (size_t e = 0; e < mesh.edges.size(); ++e) {
    if (mesh.edges[e].triangle[0] < 0) continue;
    ids.push_back(static_cast<int>(e));
    vertices.insert(vertices.end(), mesh.edges[e].vertex, mesh.edges[e].vertex + 2);
  }
  levels.Order(vertices.data(), static_cast<int>(ids.size()), 2, counts.data(), count + 1, &edge_order_);
  for (int& i : edge_order_) i = i < 0 ? -1 : ids[i];
  edges_.resize(edge_order_.size() / kBlock);
  for (size_t i = 0; i < edge_order_.size(); ++i) {
    EdgeBlock& block = edges_[i / kBlock];
    const int lane = i % kBlock, e = edge_order_[i];
    block.vertex[0][lane] = block.vertex[1][lane] = dummy;
    block.start[0][lane] = block.length[lane] = block.before[lane] = block.gamma[lane] = 1;
    block.start[1][lane] = block.start[2][lane] = block.keep[lane] = block.impulse[lane] = 0;
    if (e < 0) continue;
    const Mesh::Edge& edge = mesh.edges[e];
    // Diagonals are softer, but their dashpots are as strong.
    const double inverse_mass = (1 / mesh.mass[edge.vertex[0]] + 1 / mesh.mass[edge.vertex[1]]) / 2;
    const double stiffness = SweptStiffness(EdgeStiffness(mesh, edge), inverse_mass, h_);
    const double full = FullStiffness(mesh, edge);
    const double damping = mesh.materials[mesh.part[edge.vertex[0]]].stretch_damping * full / stiffness;
    const Compliance row = Comply(stiffness, damping, h_);
    for (int k = 0; k < 2; ++k) block.vertex[k][lane] = edge.vertex[k];
    block.length[lane] = static_cast<float>(edge.length);
    block.gamma[lane] = static_cast<float>(row.gamma);
    block.keep[lane] = static_cast<float>(1 - row.b);
  }

  bend_interval_ = kBendInterval;
  for (const Mesh::Hinge& hinge : mesh.hinges) {
    const Compliance row = Comply(hinge.stiffness, hinge.damping, kBendInterval * h_);
    if (row.gamma < kSoft * HingeMass(hinge, mesh.mass)) bend_interval_ = 1;
  }
  vertices.clear();
  for (const Mesh::Hinge& hinge : mesh.hinges) {
    for (int v : hinge.vertex) vertices.push_back(v < 0 ? dummy : v);
  }
  std::vector<std::uint8_t> without_dummy = counts;
  without_dummy[dummy] = 0;
  levels.Order(vertices.data(), static_cast<int>(mesh.hinges.size()), 4, without_dummy.data(), count + 1,
               &hinge_order_);
  hinges_.resize(hinge_order_.size() / kBlock);
  for (size_t i = 0; i < hinge_order_.size(); ++i) {
    HingeBlock& block = hinges_[i / kBlock];
    const int lane = i % kBlock, id = hinge_order_[i];
    block.gamma[lane] = 1;
    block.keep[lane] = 0;
    for (int k = 0; k < 3; ++k) block.start[k][lane] = block.before[k][lane] = 0;
    for (int k = 0; k < 4; ++k) block.vertex[k][lane] = dummy, block.weight[k][lane] = 0;
    if (id < 0) continue;
    const Mesh::Hinge& hinge = mesh.hinges[id];
    const Compliance row = Comply(hinge.stiffness, hinge.damping, bend_interval_ * h_);
    block.gamma[lane] = static_cast<float>(row.gamma);
    block.keep[lane] = static_cast<float>(1 - row.b);
    for (int k = 0; k < 4; ++k) {
      block.vertex[k][lane] = hinge.vertex[k] < 0 ? dummy : hinge.vertex[k];
      block.weight[k][lane] = static_cast<float>(hinge.weight[k]);
    }
  }

  chains_.clear();
  for (const Mesh::Chain& chain : mesh.chains) {
    ChainRow row;
    row.vertex = chain.vertex;
    row.edge = chain.edge;
    for (int e : chain.edge) {
      const Mesh::Edge& edge = mesh.edges[e];
      const double damping = mesh.materials[mesh.part[edge.vertex[0]]].stretch_damping;
      const Compliance compliance = Comply(EdgeStiffness(mesh, edge), damping, h_);
      row.length.push_back(static_cast<float>(edge.length));
      row.gamma.push_back(static_cast<float>(compliance.gamma));
      row.keep.push_back(static_cast<float>(1 - compliance.b));
    }
    const size_t size = chain.edge.size();
    row.start.resize(3 * size);
    for (auto* a : {&row.before, &row.impulse}) a->resize(size);
    for (auto* a : {&row.lower, &row.diagonal, &row.right}) a->resize(size);
    row.normal.resize(3 * size);
    chains_.push_back(row);
  }
  layers_.Reset(mesh, *kernels_);
}

// Drag of the air on triangles that move along their normals, by their speed at the end of the step.
void Solver::AddDrag(const Mesh& mesh, const Start& start, std::vector<double>* acceleration) const {
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const Material& material = mesh.materials[mesh.part[triangle.vertex[0]]];
    if (material.drag <= 0) continue;
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
    const double damped = own * rate * Dot(n, v + timestep_ * a) / (1 + rate * timestep_);
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

// A vertex of mass m that moves along its normal takes a mass a of air along, unless it touches something: of a push,
// the share a / (m + a) goes into the air. Contact has to bear all the weight.
void Solver::StartAir(const Mesh& mesh, const Start& start) {
  moves_air_ = false;
  for (const Material& material : mesh.materials) moves_air_ |= material.added_mass > 0;
  if (!moves_air_) return;
  std::fill(air_.begin(), air_.end(), 0.0f);
  std::vector<double> area(mesh.NumVertices());
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const int* v = triangle.vertex;
    const Vector a = FromArray(&start.position[3 * v[0]]), b = FromArray(&start.position[3 * v[1]]);
    const Vector n = Cross(b - a, FromArray(&start.position[3 * v[2]]) - a);
    for (int k = 0; k < 3; ++k) {
      area[v[k]] += triangle.area / 3;
      air_[4 * v[k]] += static_cast<float>(n.x);
      air_[4 * v[k] + 1] += static_cast<float>(n.y);
      air_[4 * v[k] + 2] += static_cast<float>(n.z);
    }
  }
  std::vector<bool> touches(mesh.NumVertices());
  for (const Pair& pair : layers_.pairs) {
    const int* v = pair.vertex;
    if (pair.distance > (1 + kTouching) * mesh.thickness[mesh.Pair(v[0], v[3])]) continue;
    for (int k = 0; k < 4; ++k) touches[v[k]] = true;
  }
  for (const ActivePlane& plane : planes_) {
    for (int v = 0; v < mesh.NumVertices(); ++v) {
      if (plane.gap[v] < kTouching * mesh.radius[mesh.part[v]]) touches[v] = true;
    }
  }
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    float* n = &air_[4 * v];
    const double air = mesh.materials[mesh.part[v]].added_mass * area[v];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const bool moves = !touches[v] && start.inverse_mass[v] > 0 && length > 0;
    const float scale = moves ? static_cast<float>(std::sqrt(air / (mesh.mass[v] + air))) / length : 0;
    for (int k = 0; k < 3; ++k) n[k] *= scale;
  }
}

void Solver::StartPoints(const Mesh& mesh, const Start& start) {
  std::vector<double> acceleration = start.acceleration;
  AddDrag(mesh, start, &acceleration);
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    const float w = start.inverse_mass[v];
    for (int k = 0; k < 3; ++k) {
      now_[4 * v + k] = 0;
      before_[4 * v + k] = static_cast<float>(-h_ * start.velocity[3 * v + k]);
      drift_[4 * v + k] = w > 0 ? static_cast<float>(h_ * h_ * acceleration[3 * v + k]) : 0;
      bent_drift_[4 * v + k] = drift_[4 * v + k];
    }
    now_[4 * v + 3] = before_[4 * v + 3] = w;
  }
}

void Solver::StartEdges(const Start& start, const double* after) {
  const double* x = start.position.data();
  // From the second to the first vertex; returns the length.
  const auto apart = [&](int a, int b, float* out[3]) {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
      *out[k] = static_cast<float>(x[3 * a + k] - x[3 * b + k]);
      square += *out[k] * *out[k];
    }
    return std::sqrt(square);
  };
  for (size_t i = 0; i < edge_order_.size(); ++i) {
    if (edge_order_[i] < 0) continue;
    EdgeBlock& block = edges_[i / kBlock];
    const int lane = i % kBlock;
    float* to[3] = {&block.start[0][lane], &block.start[1][lane], &block.start[2][lane]};
    const float length = apart(block.vertex[0][lane], block.vertex[1][lane], to);
    block.before[lane] = length - static_cast<float>(after[edge_order_[i]]);
  }
  for (ChainRow& chain : chains_) {
    for (size_t e = 0; e < chain.length.size(); ++e) {
      float* to[3] = {&chain.start[3 * e], &chain.start[3 * e + 1], &chain.start[3 * e + 2]};
      const float length = apart(chain.vertex[e + 1], chain.vertex[e], to);
      chain.before[e] = length - static_cast<float>(after[chain.edge[e]]);
    }
  }
}

void Solver::StartHinges(const Start& start) {
  for (size_t i = 0; i < hinge_order_.size(); ++i) {
    if (hinge_order_[i] < 0) continue;
    HingeBlock& block = hinges_[i / kBlock];
    const int lane = i % kBlock;
    for (int k = 0; k < 3; ++k) {
      double sum = 0;
      for (int c = 0; c < 4; ++c) {
        const size_t v = block.vertex[c][lane];
        if (3 * v < start.position.size()) sum += block.weight[c][lane] * start.position[3 * v + k];
      }
      block.start[k][lane] = block.before[k][lane] = static_cast<float>(sum);
    }
  }
}

void Solver::StartPlanes(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes) {
  planes_.resize(planes.size());
  const int count = mesh.NumVertices();
  for (size_t p = 0; p < planes.size(); ++p) {
    const PlaneContact& contact = planes[p];
    ActivePlane& active = planes_[p];
    active.gap.assign(points_.count, 1e3f);
    active.friction.assign(points_.count, 0);
    active.impulse.assign(4 * points_.count, 0);
    active.blocks.clear();
    active.near_blocks.clear();
    for (int v = 0; v < count; ++v) {
      const int part = mesh.part[v];
      if (!contact.touches[part]) continue;
      double gap = -mesh.radius[part], speed = 0;
      for (int k = 0; k < 3; ++k) {
        gap += contact.normal[k] * (start.position[3 * v + k] - contact.point[k]);
        speed += start.velocity[3 * v + k] * start.velocity[3 * v + k];
      }
      active.gap[v] = static_cast<float>(gap);
      active.friction[v] = contact.friction[part];
      const int block = v / kBlock * kBlock;
      if (gap < 2 * timestep_ * std::sqrt(speed) + kPlaneMargin &&
          (active.blocks.empty() || active.blocks.back() != block)) {
        active.blocks.push_back(block);
      }
    }
    // With bodies about, vertices that the repeated rows push are pushed as often by the floor.
    if (!near_.empty()) {
      std::vector<int> far;
      for (int block : active.blocks) {
        bool repeat = false;
        for (int v = block; v < block + kBlock; ++v) repeat |= v < count && layers_.IsNear(v);
        (repeat ? active.near_blocks : far).push_back(block);
      }
      active.blocks = far;
    }
    for (int k = 0; k < 3; ++k) active.normal[k] = static_cast<float>(contact.normal[k]);
  }
}

Plane Solver::ActivePlane::View(const std::vector<int>& some) {
  return {{normal[0], normal[1], normal[2]}, gap.data(), friction.data(), impulse.data(), some.data(),
          static_cast<int>(some.size())};
}

void Solver::FindLayers(const Mesh& mesh, const Start& start, const Solids& solids, const Kept& kept) {
  double* reference = kept.reference;
  const int count = mesh.NumVertices();
  position_.assign(4 * (count + 1), 0);
  move_.assign(4 * (count + 1), 0);
  double mean[3] = {0, 0, 0};
  for (int v = 0; v < count; ++v) {
    for (int k = 0; k < 3; ++k) mean[k] += timestep_ * start.velocity[3 * v + k] / count;
  }
  bool moves = false;
  for (int v = 0; v < count; ++v) {
    double away = 0, way = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = start.position[3 * v + k] - reference[3 * v + k], u = timestep_ * start.velocity[3 * v + k];
      away += d * d;
      way += u * u;
    }
    const bool stands = way < kHysteresis * kHysteresis;
    moves |= !stands;
    for (int k = 0; k < 3; ++k) {
      if (away > kHysteresis * kHysteresis) reference[3 * v + k] = start.position[3 * v + k];
      position_[4 * v + k] = static_cast<float>(reference[3 * v + k]);
      move_[4 * v + k] = stands ? 0 : static_cast<float>(timestep_ * start.velocity[3 * v + k]);
    }
  }
  // A cloth that is carried as a whole closes nothing.
  for (int v = 0; moves && v < count; ++v) {
    for (int k = 0; k < 3; ++k) move_[4 * v + k] -= static_cast<float>(mean[k]);
  }
  near_.clear();
  if (solids.TouchesBodies()) {
    near_.assign(count + 1, false);
    solids.MarkNear(&near_);
  }
  layers_.MakeRows(mesh, position_, move_, start.inverse_mass, near_, contact_.gamma);
  layers_.Start(mesh, start.position.data(), kept.after_layers);
}

// All edges at once: they form a tridiagonal system (Thomas' algorithm).
void Solver::SolveChain(ChainRow* chain) {
  const size_t size = chain->length.size();
  double* n = chain->normal.data();
  for (size_t e = 0; e < size; ++e) {
    const float *a = &now_[4 * chain->vertex[e]], *b = &now_[4 * chain->vertex[e + 1]];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      n[3 * e + k] = static_cast<double>(chain->start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += n[3 * e + k] * n[3 * e + k];
    }
    const double now = std::max(std::sqrt(square), 1e-9);
    for (int k = 0; k < 3; ++k) n[3 * e + k] /= now;
    const double length = chain->length[e];
    double diagonal = static_cast<double>(a[3]) + b[3] + chain->gamma[e];
    double right = -((now - length) - chain->keep[e] * (chain->before[e] - length));
    chain->lower[e] = 0;
    if (e > 0) {
      const double* m = n + 3 * e - 3;
      const double side = -a[3] * (m[0] * n[3 * e] + m[1] * n[3 * e + 1] + m[2] * n[3 * e + 2]);
      const double ratio = side / chain->diagonal[e - 1];
      diagonal -= ratio * side;
      right -= ratio * chain->right[e - 1];
      chain->lower[e] = side;
    }
    chain->diagonal[e] = diagonal;
    chain->right[e] = right;
  }
  double impulse = 0;
  for (size_t i = size; i-- > 0;) {
    const double side = i + 1 < size ? chain->lower[i + 1] : 0;
    impulse = (chain->right[i] - side * impulse) / chain->diagonal[i];
    chain->impulse[i] = static_cast<float>(impulse);
    float *a = &now_[4 * chain->vertex[i]], *b = &now_[4 * chain->vertex[i + 1]];
    for (int k = 0; k < 3; ++k) {
      a[k] = static_cast<float>(a[k] - a[3] * impulse * n[3 * i + k]);
      b[k] = static_cast<float>(b[k] + b[3] * impulse * n[3 * i + k]);
    }
  }
  for (size_t e = 0; e < size; ++e) {
    const float *a = &now_[4 * chain->vertex[e]], *b = &now_[4 * chain->vertex[e + 1]];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = static_cast<double>(chain->start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += d * d;
    }
    chain->before[e] = static_cast<float>(std::sqrt(square));
  }
}

void Solver::AddHoldingForces(const Mesh& mesh) {
  // An impulse of a substep, times h, is a force times h^2.
  const double share = 1 / (h_ * h_ * settings_.substeps);
  const auto add = [&](int v, const float* to, float impulse, double sign) {
    if (v >= mesh.NumVertices() || now_[4 * v + 3] > 0) return;
    double length = 0;
    for (int k = 0; k < 3; ++k) length += static_cast<double>(to[k]) * to[k];
    length = std::max(std::sqrt(length), 1e-9);
    for (int k = 0; k < 3; ++k) holding_forces_[3 * v + k] += sign * share * impulse * to[k] / length;
  };
  for (int i : held_edges_) {
    const EdgeBlock& block = edges_[i / kBlock];
    const int lane = i % kBlock, a = block.vertex[0][lane], b = block.vertex[1][lane];
    float d[3];
    for (int k = 0; k < 3; ++k) d[k] = block.start[k][lane] + (now_[4 * a + k] - now_[4 * b + k]);
    add(a, d, block.impulse[lane], 1);
    add(b, d, block.impulse[lane], -1);
  }
  for (const ChainRow& chain : chains_) {
    for (size_t e = 0; e < chain.length.size(); ++e) {
      const float d[3] = {static_cast<float>(chain.normal[3 * e]), static_cast<float>(chain.normal[3 * e + 1]),
                          static_cast<float>(chain.normal[3 * e + 2])};
      add(chain.vertex[e + 1], d, chain.impulse[e], 1);
      add(chain.vertex[e], d, chain.impulse[e], -1);
    }
  }
}

void Solver::Substep(int substep, Solids* solids) {
  const int near = layers_.num_near(), all = static_cast<int>(layers_.blocks.size());
  const bool repeats = solids->TouchesBodies() && settings_.sweeps > 1;
  const bool warm = solids->TouchesLightBodies() && substep > 0;
  LayerBlock* layers = layers_.blocks.data();
  if (substep % bend_interval_ == 0 && !hinges_.empty()) {
    kernels_->Bend(points_, hinges_.data(), static_cast<int>(hinges_.size()), static_cast<float>(bend_interval_));
  }
  kernels_->Move(points_);
  solids->Move();
  const int to_search = std::min(search_interval_, settings_.substeps - substep);
  solids->Find(*kernels_, points_, substep % search_interval_ == 0 ? to_search : 0);
  kernels_->SweepEdges(points_, edges_.data(), static_cast<int>(edges_.size()));
  for (ChainRow& chain : chains_) SolveChain(&chain);
  if (moves_air_) kernels_->MoveAir(points_);
  if (warm) {
    kernels_->WarmLayers(points_, layers, near, kWarm);
    solids->Warm(*kernels_, points_, kWarm);
    for (ActivePlane& plane : planes_) kernels_->WarmPlane(points_, plane.Near(), kWarm);
  }
  const Turn turn = {!warm, !repeats};
  kernels_->SweepLayers(points_, contact_, layers, near, turn);
  kernels_->SweepLayers(points_, contact_, layers + near, all - near, {true, true});
  if (substep + 1 == settings_.substeps) with_layers_ = now_;
  solids->Sweep(*kernels_, points_, contact_, turn);
  for (ActivePlane& plane : planes_) {
    kernels_->SweepPlane(points_, plane_row_, plane.Far(), {true, true});
    kernels_->SweepPlane(points_, plane_row_, plane.Near(), turn);
  }
  for (int sweep = 1; repeats && sweep < settings_.sweeps; ++sweep) {
    const Turn again = {false, sweep + 1 == settings_.sweeps};
    solids->Sweep(*kernels_, points_, contact_, again);
    kernels_->SweepLayers(points_, contact_, layers, near, again);
    for (ActivePlane& plane : planes_) kernels_->SweepPlane(points_, plane_row_, plane.Near(), again);
  }
  solids->Finish();
}

void Solver::Step(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes, Solids* solids,
                  const Kept& kept, Motion* motion) {
  FindLayers(mesh, start, *solids, kept);
  search_interval_ = solids->fastest() * kSearchInterval > settings_.substeps * kSearchWay ? 1 : kSearchInterval;
  StartPoints(mesh, start);
  StartEdges(start, kept.after_edge);
  StartHinges(start);
  StartPlanes(mesh, start, planes);
  StartAir(mesh, start);
  holding_forces_.assign(3 * mesh.NumVertices(), 0);
  held_edges_.clear();
  for (size_t i = 0; i < edge_order_.size(); ++i) {
    const EdgeBlock& block = edges_[i / kBlock];
    const int lane = i % kBlock;
    if (edge_order_[i] < 0) continue;
    if (now_[4 * block.vertex[0][lane] + 3] > 0 && now_[4 * block.vertex[1][lane] + 3] > 0) continue;
    held_edges_.push_back(static_cast<int>(i));
  }
  for (int substep = 0; substep < settings_.substeps; ++substep) {
    Substep(substep, solids);
    AddHoldingForces(mesh);
  }
  Keep(mesh.NumVertices(), kept);
  Finish(mesh, start, motion);
}

void Solver::Keep(int count, const Kept& kept) const {
  for (int v = 0; v < count; ++v) {
    kept.holding_force[v] = mju_norm3(&holding_forces_[3 * v]);
    for (int k = 0; k < 3; ++k) kept.after_layers[3 * v + k] = now_[4 * v + k] - with_layers_[4 * v + k];
  }
  const auto length = [&](int a, int b, const float start[3]) {
    float square = 0;
    for (int k = 0; k < 3; ++k) {
      const float d = start[k] + (now_[4 * a + k] - now_[4 * b + k]);
      square += d * d;
    }
    return std::sqrt(square);
  };
  for (size_t i = 0; i < edge_order_.size(); ++i) {
    if (edge_order_[i] < 0) continue;
    const EdgeBlock& block = edges_[i / kBlock];
    const int lane = i % kBlock;
    const float start[3] = {block.start[0][lane], block.start[1][lane], block.start[2][lane]};
    kept.after_edge[edge_order_[i]] = length(block.vertex[0][lane], block.vertex[1][lane], start) - block.before[lane];
  }
  for (const ChainRow& chain : chains_) {
    for (size_t e = 0; e < chain.length.size(); ++e) {
      kept.after_edge[chain.edge[e]] =
          length(chain.vertex[e + 1], chain.vertex[e], &chain.start[3 * e]) - chain.before[e];
    }
  }
}

// What moves as one with something that is held must not be pulled into a plane by it.
void Solver::StayAbovePlanes(const Start& start, Motion* motion) const {
  for (const ActivePlane& plane : planes_) {
    for (size_t v = 0; v < start.inverse_mass.size(); ++v) {
      if (start.inverse_mass[v] == 0) continue;
      double *move = &motion->move[3 * v], *velocity = &motion->velocity[3 * v], way = 0, speed = 0;
      for (int k = 0; k < 3; ++k) {
        way += plane.normal[k] * move[k];
        speed += plane.normal[k] * velocity[k];
      }
      const double lift = std::min<double>(plane.gap[v], -kPressed) - (plane.gap[v] + way);
      if (!(lift > 0)) continue;
      for (int k = 0; k < 3; ++k) {
        move[k] += lift * plane.normal[k];
        velocity[k] -= std::min(speed, 0.0) * plane.normal[k];
      }
    }
  }
}

void Solver::Finish(const Mesh& mesh, const Start& start, Motion* motion) {
  const int count = mesh.NumVertices();
  motion->start = start.position.data();
  motion->move.resize(3 * count);
  motion->velocity.resize(3 * count);
  motion->mass = start.mass;
  for (int v = 0; v < count; ++v) {
    const bool held = start.inverse_mass[v] == 0;
    if (held) motion->mass[v] = 1e12;
    for (int k = 0; k < 3; ++k) {
      const float now = now_[4 * v + k];
      motion->move[3 * v + k] = held ? timestep_ * start.velocity[3 * v + k] : now;
      motion->velocity[3 * v + k] =
          held ? start.velocity[3 * v + k] : (static_cast<double>(now) - before_[4 * v + k]) / h_;
    }
  }
  int changed = PreventImpacts(*kernels_, layers_.pairs, motion);
  // Pairs that were not of interest may be by now.
  const float most = kVouched * *std::min_element(mesh.thickness.begin(), mesh.thickness.end());
  for (int search = 0; search < kMaxSearches; ++search) {
    AlignedFloats end(move_.size(), 0);
    double mean[3] = {0, 0, 0};
    for (int v = 0; v < count; ++v) {
      for (int k = 0; k < 3; ++k) mean[k] += motion->move[3 * v + k] / count;
    }
    float furthest = 0;
    for (int v = 0; v < count; ++v) {
      float square = 0;
      for (int k = 0; k < 3; ++k) {
        end[4 * v + k] = static_cast<float>(motion->move[3 * v + k] - mean[k]);
        const float d = end[4 * v + k] - move_[4 * v + k];
        square += d * d;
      }
      furthest = std::max(furthest, square);
    }
    if (furthest <= most * most) break;
    move_ = end;
    layers_.Find(mesh, position_, move_);
    layers_.Forget();
    const int more = PreventImpacts(*kernels_, layers_.pairs, motion);
    changed += more;
    if (!more) break;
  }
  if (changed) StayAbovePlanes(start, motion);
}

}  // namespace softgym_mj::cloth
