#include "cloth/plugin/solver.h"

#include <algorithm>

#include <mujoco/mujoco.h>

#include "cloth/plugin/air.h"
#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
namespace {

constexpr double kRecovery = 1;  // [m/s] Largest speed of recovery from overlaps.
// Stiffness of planes relative to other contacts; they are solved last, so that no other row undoes them.
constexpr float kFirm = 5;

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
  const int padded = (mesh.NumVertices() + 1 + kBlock - 1) / kBlock * kBlock;
  for (AlignedFloats* a : {&now_, &before_, &drift_, &bent_drift_, &predicted_, &moved_, &air_})
    a->assign(4 * padded, 0);
  points_ = {padded,        now_.data(), before_.data(), drift_.data(), bent_drift_.data(), predicted_.data(),
             moved_.data(), air_.data()};
  edges_.Reset(mesh, h_);
  hinges_.Reset(mesh, h_);
  chains_.Reset(mesh, h_);
  twists_.Reset(mesh, h_);
  layers_.Reset(mesh, *kernels_);
}

void Solver::StartPoints(const Mesh& mesh, const Start& start) {
  acceleration_ = start.acceleration;
  AddDrag(mesh, start, timestep_, &acceleration_);
  for (int v = 0; v < mesh.NumVertices(); ++v) {
    const float w = start.inverse_mass[v];
    for (int k = 0; k < 3; ++k) {
      now_[4 * v + k] = 0;
      before_[4 * v + k] = static_cast<float>(-h_ * start.velocity[3 * v + k]);
      drift_[4 * v + k] = w > 0 ? static_cast<float>(h_ * h_ * acceleration_[3 * v + k]) : 0;
      bent_drift_[4 * v + k] = drift_[4 * v + k];
    }
    now_[4 * v + 3] = before_[4 * v + 3] = w;
  }
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
  // Rigid motion of a whole cloth brings no layers together.
  for (int v = 0; moves && v < count; ++v) {
    for (int k = 0; k < 3; ++k) move_[4 * v + k] -= static_cast<float>(mean[k]);
  }
  near_.clear();
  if (solids.TouchesBodies()) {
    near_.assign(count + 1, false);
    solids.MarkNear(&near_);
  }
  layers_.MakeRows(mesh, position_, move_, start.yielding, near_, contact_.gamma);
  layers_.Start(mesh, start.position.data(), kept.after_layers, Kept::kPairs * mesh.NumVertices());
}

void Solver::Substep(int substep, Solids* solids, Tied* tied) {
  const int near = layers_.num_near(), all = static_cast<int>(layers_.blocks.size());
  const bool repeats = Repeats(*solids);
  const bool warm = solids->TouchesLightBodies() && substep > 0;
  LayerBlock* layers = layers_.blocks.data();
  // Releases held vertices for a sweep, and transmits impulses on tied ones to their bodies.
  const auto two_way_pass = [&](const auto& sweep) {
    driven_.TwoWayPass(points_, sweep);
    tied->Pass(points_);
  };
  tied->Release(points_);
  twists_.Push(points_);
  hinges_.Bend(*kernels_, points_, substep);
  kernels_->Move(points_);
  solids->Move();
  tied->Move(points_);
  const int to_search = std::min(search_interval_, settings_.substeps - substep);
  solids->Find(*kernels_, points_, substep % search_interval_ == 0 ? to_search : 0);
  edges_.Sweep(*kernels_, points_);
  chains_.Solve(points_, false);
  tied->Pass(points_);
  chains_.End(points_);
  if (moves_air_) kernels_->MoveAir(points_);
  if (warm) {
    two_way_pass([&] { kernels_->WarmLayers(points_, layers, near, kWarm); });
    solids->Warm(*kernels_, points_, kWarm);
    two_way_pass([&] { planes_.Warm(*kernels_, points_, kWarm); });
  }
  const SweepPass pass = {!warm, !repeats};
  two_way_pass([&] {
    kernels_->SweepLayers(points_, contact_, layers, near, pass);
    kernels_->SweepLayers(points_, contact_, layers + near, all - near, {true, true});
  });
  if (substep + 1 == settings_.substeps) with_layers_ = now_;
  solids->Sweep(*kernels_, points_, contact_, pass);
  two_way_pass([&] { planes_.Sweep(*kernels_, points_, plane_row_, pass); });
  for (int sweep = 1; repeats && sweep < settings_.sweeps; ++sweep) {
    const SweepPass again = {false, sweep + 1 == settings_.sweeps};
    solids->Sweep(*kernels_, points_, contact_, again);
    two_way_pass([&] {
      kernels_->SweepLayers(points_, contact_, layers, near, again);
      planes_.SweepNear(*kernels_, points_, plane_row_, again);
    });
  }
  solids->Finish();
  tied->Hold(points_);
}

bool Solver::Step(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes, Solids* solids,
                  Tied* tied, const Kept& kept, Motion* motion) {
  FindLayers(mesh, start, *solids, kept);
  const bool complete = layers_.complete() && solids->complete();
  search_interval_ = SearchInterval(solids->fastest(), settings_.substeps);
  StartPoints(mesh, start);
  driven_.Start(start);
  edges_.Start(start, kept.after_edge);
  hinges_.Start(start.position);
  chains_.Start(start.position, kept.after_edge);
  twists_.Start(start, kept.twist);
  planes_.Start(mesh, start, planes, solids->TouchesBodies() ? &layers_ : nullptr, points_, timestep_);
  moves_air_ = StartAir(mesh, start, layers_.pairs, planes_, &air_);
  holding_forces_.assign(3 * mesh.NumVertices(), 0);
  // An impulse of a substep, times h, is a force times h^2.
  const double share = 1 / (h_ * h_ * settings_.substeps);
  for (int substep = 0; substep < settings_.substeps; ++substep) {
    Substep(substep, solids, tied);
    edges_.AddHoldingForces(points_, share, &holding_forces_);
    chains_.AddHoldingForces(points_, share, &holding_forces_);
  }
  chains_.Solve(points_, true);
  chains_.End(points_);
  layers_.Keep(mesh, points_, with_layers_.data(), Repeats(*solids), kept.after_layers,
               Kept::kPairs * mesh.NumVertices());
  edges_.Keep(points_, kept.after_edge);
  chains_.Keep(points_, kept.after_edge);
  for (int v = 0; v < mesh.NumVertices(); ++v) kept.holding_force[v] = mju_norm3(&holding_forces_[3 * v]);
  Finish(mesh, start, solids, motion);
  return complete && layers_.complete();
}

void Solver::Follow(const Motion& motion) {
  for (size_t v = 0; v < motion.mass.size(); ++v) {
    for (int k = 0; k < 3; ++k) now_[4 * v + k] = static_cast<float>(motion.move[3 * v + k]);
  }
}

int Solver::Prevent(Motion* motion) {
  const auto prevent = [&] { return impact_zones_.Prevent(*kernels_, layers_.all(), Zones::kMove, motion); };
  int more = prevent(), changed = more;
  for (int pass = 0; more && pass < kRopePasses && !chains_.rows().empty(); ++pass) {
    Follow(*motion);
    for (int solve = 0; solve < kRopeSolves; ++solve) chains_.Solve(points_, true);
    for (size_t v = 0; v < motion->mass.size(); ++v) {
      const bool moves = now_[4 * v + 3] > 0;
      for (int k = 0; moves && k < 3; ++k) motion->move[3 * v + k] = now_[4 * v + k];
    }
    more = prevent();
    changed += more;
  }
  return changed;
}

void Solver::Finish(const Mesh& mesh, const Start& start, Solids* solids, Motion* motion) {
  const int count = mesh.NumVertices();
  motion->start = start.position.data();
  motion->move.resize(3 * count);
  motion->velocity.resize(3 * count);
  motion->mass = mesh.mass;
  for (int v = 0; v < count; ++v) {
    const bool held = start.inverse_mass[v] == 0;
    if (held || start.rides[v]) motion->mass[v] = 1e12;
    for (int k = 0; k < 3; ++k) {
      const float now = now_[4 * v + k];
      motion->move[3 * v + k] = held ? timestep_ * start.velocity[3 * v + k] : now;
      motion->velocity[3 * v + k] =
          held ? start.velocity[3 * v + k] : (static_cast<double>(now) - before_[4 * v + k]) / h_;
    }
  }
  driven_.Finish(mesh, timestep_, motion);
  int changed = Prevent(motion);
  // Pairs beyond the search margin may be close by now.
  const float most = kSearchMargin * *std::min_element(mesh.thickness.begin(), mesh.thickness.end());
  for (int search = 0; search < kMaxSearches; ++search) {
    end_.assign(move_.size(), 0);
    double mean[3] = {0, 0, 0};
    for (int v = 0; v < count; ++v) {
      for (int k = 0; k < 3; ++k) mean[k] += motion->move[3 * v + k] / count;
    }
    float furthest = 0;
    for (int v = 0; v < count; ++v) {
      float square = 0;
      for (int k = 0; k < 3; ++k) {
        end_[4 * v + k] = static_cast<float>(motion->move[3 * v + k] - mean[k]);
        const float d = end_[4 * v + k] - move_[4 * v + k];
        square += d * d;
      }
      furthest = std::max(furthest, square);
    }
    if (furthest <= most * most) break;
    move_ = end_;
    layers_.Find(mesh, position_, move_);
    layers_.Forget();
    const int more = Prevent(motion);
    changed += more;
    if (!more) break;
  }
  if (!changed) return;
  for (int round = 0; round < kLifts; ++round) {
    before_ = now_;
    Follow(*motion);
    solids->Find(*kernels_, points_, 1);
    solids->LiftOut(points_, motion);
  }
  // Zones that are squeezed against a plane stop.
  if (planes_.LiftOut(start, motion)) impact_zones_.Prevent(*kernels_, layers_.all(), Zones::kStand, motion);
}

}  // namespace softgym_mj::cloth
