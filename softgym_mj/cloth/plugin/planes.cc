#include "cloth/plugin/planes.h"

#include <algorithm>
#include <cmath>

#include "cloth/plugin/method.h"

namespace softgym_mj::cloth {
Plane Planes::Active::View(const std::vector<int>& some) {
  return {{normal[0], normal[1], normal[2]}, gap.data(), friction.data(), impulse.data(), some.data(),
          static_cast<int>(some.size())};
}

void Planes::Start(const Mesh& mesh, const cloth::Start& start, const std::vector<PlaneContact>& contacts,
                   const Layers* layers, const Points& points, double timestep) {
  actives_.resize(contacts.size());
  const int count = mesh.NumVertices();
  for (size_t p = 0; p < contacts.size(); ++p) {
    const PlaneContact& contact = contacts[p];
    Active& active = actives_[p];
    active.gap.assign(points.count, kNoPlane);
    active.friction.assign(points.count, 0);
    active.impulse.assign(4 * points.count, 0);
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
      if (gap < 2 * timestep * std::sqrt(speed) + kPlaneMargin &&
          (active.blocks.empty() || active.blocks.back() != block)) {
        active.blocks.push_back(block);
      }
    }
    // With bodies near, the floor is swept as often as the repeated rows that push vertices into it.
    if (layers) {
      std::vector<int> far;
      for (int block : active.blocks) {
        bool repeat = false;
        for (int v = block; v < block + kBlock; ++v) repeat |= v < count && layers->IsNear(v);
        (repeat ? active.near_blocks : far).push_back(block);
      }
      active.blocks = far;
    }
    for (int k = 0; k < 3; ++k) active.normal[k] = static_cast<float>(contact.normal[k]);
  }
}

void Planes::MarkTouching(const Mesh& mesh, double share, std::vector<bool>* touches) const {
  for (const Active& active : actives_) {
    for (int v = 0; v < mesh.NumVertices(); ++v) {
      if (active.gap[v] < share * mesh.radius[mesh.part[v]]) (*touches)[v] = true;
    }
  }
}

void Planes::Warm(const ClothKernels& kernels, const Points& points, float share) {
  for (Active& active : actives_) kernels.WarmPlane(points, active.Near(), share);
}

void Planes::Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass) {
  for (Active& active : actives_) {
    kernels.SweepPlane(points, row, active.Far(), {true, true});
    kernels.SweepPlane(points, row, active.Near(), pass);
  }
}

void Planes::SweepNear(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass) {
  for (Active& active : actives_) kernels.SweepPlane(points, row, active.Near(), pass);
}

bool Planes::LiftOut(const cloth::Start& start, Motion* motion) const {
  bool lifted = false;
  for (const Active& plane : actives_) {
    for (size_t v = 0; v < start.yielding.size(); ++v) {
      if (start.yielding[v] == 0 || start.rides[v]) continue;
      double *move = &motion->move[3 * v], *velocity = &motion->velocity[3 * v], way = 0, speed = 0;
      for (int k = 0; k < 3; ++k) {
        way += plane.normal[k] * move[k];
        speed += plane.normal[k] * velocity[k];
      }
      const double lift = std::min<double>(plane.gap[v], -kPressed) - (plane.gap[v] + way);
      if (!(lift > 0)) continue;
      lifted = true;
      for (int k = 0; k < 3; ++k) {
        move[k] += lift * plane.normal[k];
        velocity[k] -= std::min(speed, 0.0) * plane.normal[k];
      }
    }
  }
  return lifted;
}

}  // namespace softgym_mj::cloth
