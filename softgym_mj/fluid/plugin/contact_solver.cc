#include "contact_solver.h"

#include <algorithm>
#include <cmath>

#include "native/instructions.h"

namespace softgym_mj {
namespace {

constexpr float kMomentum = 0.5f;  // Share of a sweep's changes that the next goes on with.
constexpr double kNear = 0.8;  // Edges get a row from this share of their limit on.
// Overlap is undone by this share in a step, at this speed [m/s] at most, by fewer iterations.
constexpr double kRecovery = 0.05, kRecoverySpeed = 0.15;
constexpr int kRecoveryShare = 4;
// The last part of a gap [m] is closed by half in a step, so that nothing at rest starts to hop.
constexpr double kCushion = 3e-4;
// Sweeps end when they change less than what moves one vertex by this [m].
constexpr double kDone = 1e-5;
// MuJoCo's contacts push when they overlap: one that it has not solved yet may sink in by so much [m].
constexpr double kSink = 1e-4;
constexpr double kUnbounded = 1e30;

// What a body's point at `position` moves by.
Vector PointMove(const Body& body, Vector position) {
  return body.move + Cross(body.turn, position);
}

void Push(Body* body, Vector position, Vector impulse) {
  const Vector moment = Cross(position, impulse);
  const double wrench[6] = {impulse.x, impulse.y, impulse.z, moment.x, moment.y, moment.z};
  double change[6];
  for (int i = 0; i < 6; ++i) {
    body->wrench[i] += wrench[i];
    change[i] = 0;
    for (int j = 0; j < 6; ++j) change[i] += body->compliance[i][j] * wrench[j];
  }
  body->move = body->move + Vector{change[0], change[1], change[2]};
  body->turn = body->turn + Vector{change[3], change[4], change[5]};
}

// What the body's point moves by for an impulse of one along `direction`.
Vector Response(const Body& body, Vector position, Vector direction) {
  Body pushed = body;
  pushed.move = pushed.turn = {0, 0, 0};
  Push(&pushed, position, direction);
  return PointMove(pushed, position);
}

// By how much the two of a contact may approach each other, where the solver has left `relative`
// displacement.
double Gap(const RigidContact& contact, Vector relative) {
  if (!contact.solved) return contact.gap + kSink;
  return contact.softness > 0 ? contact.gap : std::max(0.0, -Dot(contact.normal, relative));
}

template <int C>
Rows<C> NoRows(int no_vertex) {
  Rows<C> rows = {};
  for (int k = 0; k < C; ++k) std::fill_n(rows.vertex[k], kLanes, no_vertex);
  return rows;
}

template <int C>
void Forget(Rows<C>* rows) {
  std::fill_n(rows->impulse[0], Rows<C>::kParts * kLanes, 0.0f);
  std::fill_n(rows->search[0], Rows<C>::kParts * kLanes, 0.0f);
}

template <int C>
void SetRow(const int* vertex, const double* weight, Vector normal, double compliance, double least,
            double lowest, double friction, const Motion& motion, Rows<C>* rows, int lane) {
  double give = 0;
  for (int k = 0; k < C; ++k) {
    rows->vertex[k][lane] = vertex[k];
    rows->weight[k][lane] = static_cast<float>(weight[k]);
    give += weight[k] * weight[k] * motion.move[4 * vertex[k] + 3];
  }
  const double along[3] = {normal.x, normal.y, normal.z};
  for (int k = 0; k < 3; ++k) rows->normal[k][lane] = static_cast<float>(along[k]);
  rows->mass[lane] = give > 0 ? static_cast<float>(1 / (give + compliance)) : 0.0f;
  rows->compliance[lane] = static_cast<float>(compliance);
  rows->least[lane] = static_cast<float>(least);
  rows->lowest[lane] = static_cast<float>(lowest);
  rows->friction[lane] = static_cast<float>(friction);
}

}  // namespace

ContactSolver::Row* ContactSolver::AddRow(const int vertex[4], const double weight[4], Vector normal,
                                          double gap, double friction) {
  Row row = {};
  std::copy_n(vertex, 4, row.vertex);
  std::copy_n(weight, 4, row.weight);
  row.normal = normal;
  row.least = gap > 0 ? -std::max(0.5 * gap, gap - kCushion) : 0;
  row.friction = friction;
  row.gap = gap;
  rows_.push_back(row);
  return &rows_.back();
}

void ContactSolver::AddEdgeRows(const ContactConfig& config, const Mesh& mesh,
                                const Motion& motion) {
  const int none = mesh.NumVertices();
  for (const Mesh::Edge& edge : mesh.edges) {
    const int a = edge.vertex[0], b = edge.vertex[1];
    const Vector start = motion.start[a] - motion.start[b];
    const Vector end = start + motion.Move(a) - motion.Move(b);
    const double square = Dot(end, end), longest = (1 + config.stretch) * edge.length;
    const double shortest = (1 - config.compression) * edge.length;
    const double near_long = (1 + kNear * config.stretch) * edge.length;
    const double near_short = (1 - kNear * config.compression) * edge.length;
    const bool stretched = square > near_long * near_long;
    if (!stretched && square > near_short * near_short) continue;
    const int vertex[4] = {a, b, none, none};
    const double sign = stretched ? -1 : 1, length = Norm(start), weight[4] = {sign, -sign, 0, 0};
    const Vector normal = (1 / length) * start;
    const double gap = stretched ? longest - length : length - shortest;
    // What the engine does to the edge by itself is not contact's.
    const double own = -sign * Dot(normal, end - start);
    Row* row = AddRow(vertex, weight, normal, std::max({0.0, gap, own}), 0);
    row->least = -std::max({0.0, gap, own});
  }
}

void ContactSolver::AddRigidRows(const std::vector<RigidContact>& rigid, const Motion& motion,
                                 const std::vector<Body>& bodies) {
  for (const RigidContact& contact : rigid) {
    Vector relative = {0, 0, 0};
    double compliance = 0;
    BodyRow row = {};
    row.contact = contact;
    for (int k = 0; k < 3; ++k) {
      const double inverse_mass = motion.move[4 * contact.vertex[k] + 3];
      relative = relative + contact.weight[k] * motion.Move(contact.vertex[k]);
      row.scaled[k] = contact.weight[k] * inverse_mass;
      compliance += contact.weight[k] * row.scaled[k];
    }
    if (contact.body < 0) {
      if (compliance <= 0) continue;
      const double gap = Gap(contact, relative);
      const int none = static_cast<int>(motion.start.size());
      int vertex[4] = {none, none, none, none};
      double weight[4] = {0, 0, 0, 0};
      for (int k = 0; k < 3; ++k) {
        if (contact.weight[k] == 0) continue;
        vertex[k] = contact.vertex[k];
        weight[k] = contact.weight[k];
      }
      Row* added = AddRow(vertex, weight, contact.normal, gap, contact.friction);
      if (contact.solved) added->least = -gap;
      added->compliance = contact.softness;
      added->lowest = -contact.impulse;
      continue;
    }
    const Body& body = bodies[contact.body];
    relative = relative - PointMove(body, contact.position);
    const Vector response = Response(body, contact.position, contact.normal);
    double trace = Response(body, contact.position, {1, 0, 0}).x;
    trace += Response(body, contact.position, {0, 1, 0}).y;
    trace += Response(body, contact.position, {0, 0, 1}).z;
    row.mass = 1 / (compliance + Dot(response, contact.normal) + contact.softness);
    row.tangential_mass = 1 / (compliance + trace - Dot(response, contact.normal));
    row.least = -Gap(contact, relative);
    body_rows_.push_back(row);
  }
}

void ContactSolver::Apply(const BodyRow& row, Vector impulse, float* move,
                          std::vector<Body>* bodies) const {
  for (int k = 0; k < 3; ++k) {
    float* u = move + 4 * row.contact.vertex[k];
    u[0] += static_cast<float>(row.scaled[k] * impulse.x);
    u[1] += static_cast<float>(row.scaled[k] * impulse.y);
    u[2] += static_cast<float>(row.scaled[k] * impulse.z);
  }
  Push(&(*bodies)[row.contact.body], row.contact.position, -1.0 * impulse);
}

// As SweepRows and ExtendRows in contact_kernels.h, for one row.
double ContactSolver::Sweep(BodyRow* row, float* move, std::vector<Body>* bodies) const {
  const RigidContact& contact = row->contact;
  Vector r = -1.0 * PointMove((*bodies)[contact.body], contact.position);
  for (int k = 0; k < 3; ++k) {
    const float* u = move + 4 * contact.vertex[k];
    r = r + contact.weight[k] * Vector{u[0], u[1], u[2]};
  }
  row->before = row->impulse;
  row->held_before = row->held;
  const double along = Dot(contact.normal, r);
  const double wanted = row->least - along - contact.softness * row->impulse;
  row->impulse = std::max(-contact.impulse, row->impulse + row->mass * wanted);
  row->held = row->held - row->tangential_mass * (r - along * contact.normal);
  const double size = Norm(row->held), most = contact.friction * std::max(0.0, row->impulse);
  if (size > most) row->held = (most / size) * row->held;
  const Vector change =
      (row->impulse - row->before) * contact.normal + row->held - row->held_before;
  Apply(*row, change, move, bodies);
  return Dot(change, change);
}

void ContactSolver::Extend(BodyRow* row, double share, float* move,
                           std::vector<Body>* bodies) const {
  const double ahead = share * row->search;
  const Vector held_ahead = share * row->held_search;
  row->search = ahead + row->impulse - row->before;
  row->held_search = held_ahead + row->held - row->held_before;
  row->impulse += ahead;
  row->held = row->held + held_ahead;
  Apply(*row, ahead * row->contact.normal + held_ahead, move, bodies);
}

// Elasticity takes part: what contact changes spreads to the neighbours, as in MuJoCo's implicit step.
// Without it heaps are squeezed and stretched.
void ContactSolver::SetSprings(const Mesh& mesh, const Motion& motion, double timestep) {
  springs_.assign(mesh.edge_groups.size() / kLanes, NoRows<2>(mesh.NumVertices()));
  for (size_t i = 0; i < mesh.edge_groups.size(); ++i) {
    if (mesh.edge_groups[i] < 0) continue;
    const Mesh::Edge& edge = mesh.edges[mesh.edge_groups[i]];
    const int a = edge.vertex[0], b = edge.vertex[1];
    const double stiffness = (edge.stiffness * timestep + edge.damping) * timestep;
    const Vector start = motion.start[a] - motion.start[b];
    const double length = Norm(start);
    if (!(stiffness > 0 && length > 0)) continue;
    const double weight[2] = {1, -1};
    const Vector normal = (1 / length) * start;
    const double now = Dot(motion.Move(a) - motion.Move(b), normal);
    SetRow(edge.vertex, weight, normal, 1 / stiffness, now, -kUnbounded, 0, motion,
           &springs_[i / kLanes], i % kLanes);
  }
}

// Fills the groups with the rows.
void ContactSolver::Group(const Motion& motion) {
  const int none = static_cast<int>(motion.start.size());
  vertices_.clear();
  for (const Row& row : rows_) vertices_.insert(vertices_.end(), row.vertex, row.vertex + 4);
  coloring_.Order(vertices_, 4, none, &order_);
  groups_.assign(order_.size() / kLanes, NoRows<4>(none));
  for (size_t i = 0; i < order_.size(); ++i) {
    if (order_[i] < 0) continue;
    const Row& row = rows_[order_[i]];
    SetRow(row.vertex, row.weight, row.normal, row.compliance, row.least, row.lowest, row.friction,
           motion, &groups_[i / kLanes], i % kLanes);
  }
}

// Gauss-Seidel with momentum: what a sweep has changed is carried on by half in the next ones.
void ContactSolver::Iterate(int iterations, float* move, std::vector<Body>* bodies) {
  const int rows = static_cast<int>(groups_.size()), springs = static_cast<int>(springs_.size());
  float last = 0;
  for (int i = 0; i < iterations; ++i) {
    float change = kernels_->SweepSprings(springs_.data(), springs, move);
    for (BodyRow& row : body_rows_) change += static_cast<float>(Sweep(&row, move, bodies));
    change += kernels_->SweepRows(groups_.data(), rows, move);
    if (!(change > done_ * done_) || i + 1 == iterations) return;
    const float ahead = change < last ? kMomentum : 0;  // Worse than before: a new start.
    last = change;
    kernels_->ExtendRows(groups_.data(), rows, ahead, move);
    kernels_->ExtendSprings(springs_.data(), springs, ahead, move);
    for (BodyRow& row : body_rows_) Extend(&row, ahead, move, bodies);
  }
}

void ContactSolver::Solve(const ContactConfig& config, double timestep, const Mesh& mesh,
                          const std::vector<Pair>& pairs, const std::vector<RigidContact>& rigid,
                          Motion* motion, std::vector<Body>* bodies, std::vector<float>* position,
                          std::vector<Body>* position_bodies) {
  kernels_ = &ChooseContactKernels();
  rows_.clear();
  body_rows_.clear();
  double inverse_mass = 1e-30;
  for (int v = 0; v < mesh.NumVertices(); ++v) inverse_mass += motion->move[4 * v + 3];
  done_ = static_cast<float>(kDone * mesh.NumVertices() / inverse_mass);
  SetSprings(mesh, *motion, timestep);
  AddEdgeRows(config, mesh, *motion);
  AddRigidRows(rigid, *motion, *bodies);
  for (const Pair& pair : pairs) {
    if (!pair.counts) continue;
    const int contact = mesh.Pair(pair.vertex[0], pair.vertex[2]);
    AddRow(pair.vertex, pair.weight, pair.normal, pair.distance - mesh.thickness[contact],
           config.friction < 0 ? mesh.friction[contact] : config.friction);
  }
  Group(*motion);
  Iterate(config.iterations, motion->move.data(), bodies);
  // Overlap is undone by displacement alone: as a velocity it would stay.
  *position = motion->move;
  *position_bodies = *bodies;
  for (size_t i = 0; i < order_.size(); ++i) {
    if (order_[i] < 0) continue;
    const Row& row = rows_[order_[i]];
    Rows<4>& group = groups_[i / kLanes];
    const int lane = i % kLanes;
    group.least[lane] -= group.compliance[lane] * group.impulse[0][lane];
    group.lowest[lane] -= group.impulse[0][lane];
    if (row.gap < 0 && row.compliance == 0) {
      group.least[lane] =
          static_cast<float>(std::min(-kRecovery * row.gap, kRecoverySpeed * timestep));
    }
  }
  for (Rows<4>& group : groups_) Forget(&group);
  SetSprings(mesh, *motion, timestep);
  for (BodyRow& row : body_rows_) {
    row.least -= row.contact.softness * row.impulse;
    row.contact.impulse += row.impulse;
    row.impulse = 0;
    row.search = 0;
    row.held = row.held_search = {0, 0, 0};
  }
  Iterate(config.iterations / kRecoveryShare + 1, position->data(), position_bodies);
}

const ContactKernels& ChooseContactKernels() {
#ifdef SOFTGYM_MJ_X86
  if (UseAvx2()) return kAvx2ContactKernels;
#endif
  return kScalarContactKernels;
}

}  // namespace softgym_mj
