#include "cloth/plugin/tied.h"

#include <algorithm>

#include "native/pose.h"

namespace softgym_mj::cloth {
namespace {

// [kg] Largest mass of tied vertices in rows: their displacements must exceed the rounding of floats.
constexpr double kHeaviest = 0.1;

// Displacement of the point at `arm` by a twist `move` of its body.
void MovePoint(const double move[6], const double arm[3], double out[3]) {
  mju_cross(out, move + 3, arm);
  mju_addTo3(out, move);
}

}  // namespace

void Tied::Start(Bodies* bodies, double timestep, double h, cloth::Start* start) {
  h_ = h;
  bodies_ = bodies;
  riders_.clear();
  for (const Tie& tie : start->ties) {
    Rider rider = {};
    rider.tie = tie;
    rider.body = bodies->Find(tie.body);
    if (rider.body < 0 || !bodies->all()[rider.body].rigid.is_pushable) continue;
    const Body& body = bodies->all()[rider.body];
    mju_sub3(rider.start, tie.point, body.center);
    mju_copy3(rider.arm, rider.start);
    double velocity[3];
    MovePoint(body.velocity, rider.arm, velocity);
    MovePoint(body.acceleration, rider.arm, rider.acceleration);
    // Centripetal part.
    mjtNum round[3], inwards[3];
    mju_cross(round, body.velocity + 3, rider.arm);
    mju_cross(inwards, body.velocity + 3, round);
    mju_addTo3(rider.acceleration, inwards);
    const int v = tie.vertex;
    start->rides[v] = true;
    for (int k = 0; k < 3; ++k) {
      const double end = velocity[k] + timestep * rider.acceleration[k];
      // MuJoCo moves a vertex with its own slides back to the body.
      const double own = tie.mass > 0 ? start->velocity[3 * v + k] - end : 0;
      rider.own[k] = h * own;
      start->velocity[3 * v + k] = velocity[k] + own;
      start->acceleration[3 * v + k] = rider.acceleration[k];
    }
    riders_.push_back(rider);
  }
  for (Rider& rider : riders_) {
    const std::vector<Body>& all = bodies->all();
    const Body& body = all[rider.body];
    // All vertices tied to a tree may pull together: each gets a share of the mass.
    const auto shares = [&](const Rider& other) { return all[other.body].tree == body.tree; };
    const auto riders = std::count_if(riders_.begin(), riders_.end(), shares);
    const double compliance = riders * PointCompliance(body.rigid.compliance, rider.arm);
    rider.inverse_mass = static_cast<float>(std::max(compliance, 1 / kHeaviest));
    start->inverse_mass[rider.tie.vertex] = start->yielding[rider.tie.vertex] = rider.inverse_mass;
  }
}

void Tied::Release(const Points& points) const {
  for (const Rider& rider : riders_) {
    points.now[4 * rider.tie.vertex + 3] = points.before[4 * rider.tie.vertex + 3] = rider.inverse_mass;
  }
}

void Tied::Push(const Rider& rider, const double way[3]) {
  double impulse[3];
  mju_scl3(impulse, way, 1 / static_cast<double>(rider.inverse_mass));
  bodies_->Push(rider.arm, impulse, &bodies_->all()[rider.body]);
}

// Moves vertices with their bodies.
void Tied::Follow(const Points& points) {
  for (Rider& rider : riders_) {
    const float* before = points.before + 4 * rider.tie.vertex;
    double way[3];
    MovePoint(bodies_->all()[rider.body].rigid.move, rider.arm, way);
    for (int k = 0; k < 3; ++k) {
      rider.place[k] = points.now[4 * rider.tie.vertex + k] = static_cast<float>(before[k] + way[k] + rider.own[k]);
    }
  }
}

void Tied::Move(const Points& points) {
  if (riders_.empty()) return;
  // Forces of bending and air.
  for (const Rider& rider : riders_) {
    double way[3];
    for (int k = 0; k < 3; ++k) way[k] = points.bent_drift[4 * rider.tie.vertex + k] - h_ * h_ * rider.acceleration[k];
    Push(rider, way);
  }
  bodies_->Share();
  Follow(points);
}

void Tied::Pass(const Points& points) {
  if (riders_.empty()) return;
  for (const Rider& rider : riders_) {
    double way[3];
    for (int k = 0; k < 3; ++k) way[k] = static_cast<double>(points.now[4 * rider.tie.vertex + k]) - rider.place[k];
    Push(rider, way);
  }
  bodies_->Share();
  Follow(points);
}

void Tied::Hold(const Points& points) {
  for (Rider& rider : riders_) {
    const Body& body = bodies_->all()[rider.body];
    mju_rotVecQuat(rider.arm, rider.start, body.so_far.turn);
    float *now = points.now + 4 * rider.tie.vertex, *before = points.before + 4 * rider.tie.vertex;
    for (int k = 0; k < 3; ++k) {
      rider.gone[k] += rider.own[k];
      now[k] = static_cast<float>(body.so_far.shift[k] + rider.arm[k] - rider.start[k] + rider.gone[k]);
    }
    now[3] = before[3] = 0;
  }
}

void Tied::Finish(const mjModel* m, const mjData* d, Motion* motion) const {
  for (const Rider& rider : riders_) {
    if (!(rider.tie.mass > 0)) continue;
    const int body = rider.tie.body;
    Twist twist;
    const Pose pose = BodyPose(m, d, body, &twist);
    mjtNum local[3], back[4], point[3], turned[3];
    mju_sub3(local, rider.tie.point, d->xpos + 3 * body);
    mju_negQuat(back, d->xquat + 4 * body);
    mju_rotVecQuat(local, local, back);
    mju_rotVecQuat(point, local, pose.quaternion);
    mju_addTo3(point, pose.position);
    mju_cross(turned, twist.angular, point);
    for (int k = 0; k < 3; ++k) {
      motion->move[3 * rider.tie.vertex + k] = point[k] - rider.tie.point[k] + rider.gone[k];
      motion->velocity[3 * rider.tie.vertex + k] = twist.linear[k] + turned[k] + rider.own[k] / h_;
    }
  }
}

}  // namespace softgym_mj::cloth
