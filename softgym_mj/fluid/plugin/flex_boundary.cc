#include "flex_boundary.h"

#include <algorithm>
#include <cmath>

namespace softgym_mj {
namespace {

// Share of the spacing by which a substep recovers from an earlier overlap at most.
constexpr double kDigOut = 0.1;
// Share of its distance to an element that a particle must keep in a substep.
constexpr double kNearest = 0.1;
constexpr int kMaxAdvances = 100;  // Iterations, after which the features count as touching.
// Largest number of iterations that each undo the deepest overlap.
constexpr int kMaxPushes = 6;
// A particle that would pass through cloth moves along with it, at these shares of its distance.
constexpr double kCarried[] = {1.0, 0.3, 0.1, 0.01};
// [spacings] Distances that differ by less count as equal.
constexpr double kTie = 1e-4;
constexpr double kTouching = 1e-9;  // [m] Below, a distance has no direction.

Vector Position(const float* positions, int i) {
  return {positions[4 * i], positions[4 * i + 1], positions[4 * i + 2]};
}

void Store(Vector a, float* out, int i) {
  out[4 * i] = static_cast<float>(a.x);
  out[4 * i + 1] = static_cast<float>(a.y);
  out[4 * i + 2] = static_cast<float>(a.z);
}

// Computes the frame of a triangle (columns of a rotation); returns false if it has no area.
bool Frame(Vector a, Vector b, Vector c, Vector out[3]) {
  const Vector normal = Cross(b - a, c - a);
  const double side = Norm(b - a), area = Norm(normal);
  if (!(side > 0 && area > 0)) return false;
  out[0] = (1 / side) * (b - a);
  out[2] = (1 / area) * normal;
  out[1] = Cross(out[2], out[0]);
  return true;
}

Vector Normal(Vector a, Vector b, Vector c) { return Unit(Cross(b - a, c - a)); }

}  // namespace

FlexBoundary::Foot FlexBoundary::Closest(const FlexElement& e, const std::vector<Vector>& x, Vector p) const {
  Foot foot;
  ClosestOnTriangle(p, x[e.vertex[0]], x[e.vertex[1]], x[e.vertex[2]], foot.weight);
  foot.offset = p - At(e, x, foot.weight);
  foot.distance = Norm(foot.offset);
  return foot;
}

Vector FlexBoundary::At(const FlexElement& e, const std::vector<Vector>& x, const double weight[3]) const {
  return weight[0] * x[e.vertex[0]] + weight[1] * x[e.vertex[1]] + weight[2] * x[e.vertex[2]];
}

// The half space behind the tangent plane counts as filled with water, as in FindWallShare of kernels_impl.h, with a
// smooth decrease beyond the rim of a cloth. If the closest point is on a shared side, the triangle that faces the
// particle more counts.
void FlexBoundary::FindShares(const Particles& p) {
  const double reach = Reach(), tie = kTie * fluid_.spacing;
  for (Near& near : near_) {
    const float* position = p.position + 4 * near.particle;
    const Vector x = Position(p.position, near.particle);
    double nearest = reach;  // Distance to a cloth.
    double facing = 0;       // Squared cosine of the angle to its normal.
    near.gap = reach;
    near.element = -1;
    near.share = near.slope = 0;
    for (int k = near.first; k < near.last; ++k) {
      if (candidates_[k].distance - near.moved > nearest + tie) break;
      const int element = candidates_[k].element;
      const FlexElement& e = motion_->elements[element];
      const double most = (e.surface ? nearest : near.gap) + e.radius + tie;
      const ElementBound& bound = bounds_[element];
      if (bound.OutOfReach(position, static_cast<float>(most), slack_)) continue;
      const Foot foot = Closest(e, end_, x);
      const double distance = foot.distance - e.radius;
      near.gap = std::min(near.gap, distance);
      if (!e.surface || foot.distance < kTouching || distance >= nearest + tie) continue;
      const Vector normal = (1 / foot.distance) * foot.offset;
      const double cosine = Dot(normal, {bound.x[0], bound.y[0], bound.z[0]});
      if (distance >= nearest - tie && cosine * cosine <= facing) continue;
      nearest = distance;
      facing = cosine * cosine;
      near.element = element;
      std::copy(foot.weight, foot.weight + 3, near.weight);
      near.normal = normal;
    }
    if (near.element < 0) continue;
    const double u = std::clamp(1 - nearest / fluid_.radius, 0.0, 1.0), u4 = u * u * u * u;
    near.share = facing * fluid_.wall_density / fluid_.rest_density * u4 * u * (1.0 / 20 - u / 30);
    near.slope = facing * fluid_.wall_density / 3 * u4 * (0.25 - 0.2 * u);
  }
}

void FlexBoundary::MultiplyFreeShare(const Particles& p) const {
  for (const Near& near : near_) {
    p.free_share[near.particle] *= static_cast<float>(1 - near.share);
  }
}

void FlexBoundary::AddGradient(const Particles& p) {
  for (Near& near : near_) {
    if (near.share == 0) continue;
    near.slope *= p.free_share[near.particle] / (1 - near.share);
    float* gradient = p.wall_gradient + 4 * near.particle;
    gradient[0] += static_cast<float>(near.slope * near.normal.x);
    gradient[1] += static_cast<float>(near.slope * near.normal.y);
    gradient[2] += static_cast<float>(near.slope * near.normal.z);
  }
}

// Largest relative displacement of a particle that moves by `way` and a point of the element. Points move along
// straight lines, so the maximum is at a corner.
double FlexBoundary::Approach(const FlexElement& e, Vector way) const {
  double most = 0;
  for (int v : e.vertex) {
    const Vector relative = end_[v] - start_[v] - way;
    most = std::max(most, Dot(relative, relative));
  }
  return std::sqrt(most);
}

// Whether a particle on a straight path comes nearer to an element than a share of its distance. Additive
// continuous collision detection (Li, Kaufman and Jiang, Codimensional Incremental Potential Contact,
// 2021, section 5): steps that are never longer than the distance allows.
bool FlexBoundary::Meets(const FlexElement& e, Vector from, Vector way, double distance, double hold) const {
  const double nearest = kNearest * std::min(distance, hold), speed = Approach(e, way);
  if (speed <= distance - nearest || distance < kTouching) return false;
  Vector corner[3], move[3];  // Relative to the particle.
  for (int k = 0; k < 3; ++k) {
    const int v = e.vertex[k];
    corner[k] = start_[v] - from;
    move[k] = end_[v] - start_[v] - way;
  }
  double time = 0;
  for (int i = 0; i < kMaxAdvances; ++i) {
    const double advance = 0.9 * (distance - 0.5 * nearest) / speed;
    time += advance;
    if (time >= 1) return false;
    for (int k = 0; k < 3; ++k) corner[k] = corner[k] + advance * move[k];
    double w[3];
    ClosestOnTriangle({0, 0, 0}, corner[0], corner[1], corner[2], w);
    distance = Norm(w[0] * corner[0] + w[1] * corner[1] + w[2] * corner[2]);
    if (distance < nearest) return true;
  }
  return true;
}

// Displacement that keeps a particle between two positions out of an element.
FlexBoundary::Push FlexBoundary::FindPush(const FlexElement& e, Vector from, Vector x) const {
  const double hold = e.radius + fluid_.contact;
  const Vector way = x - from;
  const Foot foot = Closest(e, end_, x);
  Push push = {};
  std::copy(foot.weight, foot.weight + 3, push.weight);
  const double approach = Approach(e, way), dig_out = kDigOut * fluid_.spacing;
  if (foot.distance > hold + approach) return push;
  double target = hold, gap = foot.distance;
  Foot before;
  // Whether it may have been so near at the start of the substep that this matters.
  const bool close = gap - approach < std::max(hold - dig_out, 2 * approach);
  if (close) {
    before = Closest(e, start_, from);
    target = std::min(hold, before.distance + dig_out);
  }
  if (close && Meets(e, from, way, before.distance, hold)) {
    // Back to the side it came from: that of the plane, unless it is beside the element.
    const Vector a = end_[e.vertex[0]];
    const double height = Dot(before.offset, Normal(start_[e.vertex[0]], start_[e.vertex[1]], start_[e.vertex[2]]));
    if (std::fabs(height) > kNearest * before.distance) {
      const Vector normal = Normal(a, end_[e.vertex[1]], end_[e.vertex[2]]);
      push.direction = height > 0 ? normal : -1.0 * normal;
      gap = Dot(push.direction, x - a);
    } else {
      push.direction = (1 / before.distance) * before.offset;
      gap = Dot(push.direction, x - At(e, end_, before.weight));
    }
  } else if (foot.distance >= kTouching) {
    push.direction = (1 / foot.distance) * foot.offset;
  }
  push.length = std::max(target - gap, 0.0);
  return push;
}

void FlexBoundary::Collide(const Particles& p, float wall_push) {
  for (const Near& near : near_) {
    const int i = near.particle;
    const Vector from = Position(p.old_position, i), predicted = Position(p.position, i),
                 correction = Position(p.correction, i), target = predicted + correction;
    const double pressure_push = near.element < 0 ? 0 : wall_push * p.pressure[i] * near.slope;
    const double room = near.gap - fluid_.contact - Norm(correction) - Norm(target - from) - longest_;
    if (room > 0 && pressure_push == 0) continue;
    Vector x = target, normal = near.normal;
    int element = near.element;
    double weight[3], hardest = 0;
    std::copy(near.weight, near.weight + 3, weight);
    for (int k = 0; k < kMaxPushes && room <= 0; ++k) {
      Push deepest = {};
      const double reach = fluid_.contact + Norm(x - from) + longest_;
      const double moved = near.moved + Norm(x - predicted);
      float at[4];
      Store(x, at, 0);
      for (int c = near.first; c < near.last; ++c) {
        if (candidates_[c].distance - moved > reach) break;
        const int candidate = candidates_[c].element;
        const FlexElement& e = motion_->elements[candidate];
        const float most = static_cast<float>(reach + e.radius);
        if (bounds_[candidate].OutOfReach(at, most, slack_)) continue;
        const Push push = FindPush(e, from, x);
        if (push.length <= deepest.length) continue;
        deepest = push;
        deepest.element = candidate;
      }
      if (deepest.length <= kTouching) break;
      x = x + deepest.length * deepest.direction;
      if (deepest.length <= hardest) continue;
      hardest = deepest.length;
      element = deepest.element;
      std::copy(deepest.weight, deepest.weight + 3, weight);
    }
    if (hardest == 0 && pressure_push == 0) continue;
    if (hardest > 0) normal = (1 / std::max(Norm(x - target), kTouching)) * (x - target);
    // Coulomb friction against the push of the contact and of the pressure.
    const Vector material =
        At(motion_->elements[element], end_, weight) - At(motion_->elements[element], start_, weight);
    Vector slide = x - from - material;
    slide = slide - Dot(slide, normal) * normal;
    const double push = Norm(x - target) + pressure_push;
    x = x - std::min(fluid_.friction * push / std::max(Norm(slide), kTouching), 1.0) * slide;
    Store(x - predicted, p.correction, i);
  }
}

bool FlexBoundary::Passes(const Near& near, Vector from, Vector x) const {
  const float length = static_cast<float>(Norm(x - from) + longest_);
  float at[4];
  Store(x, at, 0);
  for (int k = near.first; k < near.last; ++k) {
    const int element = candidates_[k].element;
    const FlexElement& e = motion_->elements[element];
    if (!e.surface || bounds_[element].OutOfReach(at, length, slack_)) continue;
    const double distance = Closest(e, start_, from).distance;
    if (Meets(e, from, x - from, distance, e.radius + fluid_.contact)) return true;
  }
  return false;
}

// Where a particle gets that moves with the triangle that was nearest to it.
Vector FlexBoundary::Carry(const Near& near, Vector from) const {
  Foot nearest = {};
  const FlexElement* triangle = nullptr;
  for (int k = near.first; k < near.last; ++k) {
    const FlexElement& e = motion_->elements[candidates_[k].element];
    if (!e.surface) continue;
    const Foot foot = Closest(e, start_, from);
    if (triangle && foot.distance >= nearest.distance) continue;
    nearest = foot;
    triangle = &e;
  }
  const int* v = triangle->vertex;
  Vector before[3], after[3], offset = nearest.offset;
  if (Frame(start_[v[0]], start_[v[1]], start_[v[2]], before) && Frame(end_[v[0]], end_[v[1]], end_[v[2]], after)) {
    offset = {0, 0, 0};
    for (int k = 0; k < 3; ++k) offset = offset + Dot(before[k], nearest.offset) * after[k];
  }
  Vector x = from;
  for (double share : kCarried) {
    x = At(*triangle, end_, nearest.weight) + share * offset;
    if (!Passes(near, from, x)) break;
  }
  return x;
}

void FlexBoundary::Guard(const Particles& p) const {
  for (const Near& near : near_) {
    const int i = near.particle;
    const Vector from = Position(p.old_position, i), predicted = Position(p.position, i),
                 correction = Position(p.correction, i), x = predicted + correction;
    if (near.gap - Norm(correction) > Norm(x - from) + longest_) continue;
    if (Passes(near, from, x)) Store(Carry(near, from) - predicted, p.correction, i);
  }
}

// As the walls in Solver::DragAtWalls.
void FlexBoundary::Drag(const Particles& p, float viscosity, float h) const {
  for (const Near& near : near_) {
    const double share = std::min(viscosity * fluid_.rest_density * near.share, 1.0);
    if (share == 0) continue;
    const FlexElement& e = motion_->elements[near.element];
    const Vector material = At(e, end_, near.weight) - At(e, start_, near.weight),
                 velocity = Position(p.velocity, near.particle);
    Store(velocity + share * ((1.0 / h) * material - velocity), p.velocity, near.particle);
  }
}

}  // namespace softgym_mj
