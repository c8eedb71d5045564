#include "cloth/plugin/driven.h"

#include <algorithm>

namespace softgym_mj::cloth {

void Driven::Start(const cloth::Start& start) {
  vertices_.clear();
  for (size_t v = 0; v < start.inverse_mass.size(); ++v) {
    if (start.inverse_mass[v] == 0 && start.yielding[v] > 0) {
      vertices_.push_back({static_cast<int>(v), start.yielding[v], {}, {}});
    }
  }
}

void Driven::Release(const Points& points) {
  for (Vertex& vertex : vertices_) {
    float* now = points.now + 4 * vertex.id;
    now[3] = vertex.inverse_mass;
    std::copy_n(now, 3, vertex.place);
  }
}

void Driven::Hold(const Points& points) {
  for (Vertex& vertex : vertices_) {
    float *now = points.now + 4 * vertex.id, *before = points.before + 4 * vertex.id;
    now[3] = 0;
    for (int k = 0; k < 3; ++k) {
      const float way = now[k] - vertex.place[k];
      before[k] += way;
      vertex.given[k] += way;
    }
  }
}

void Driven::Finish(const Mesh& mesh, double timestep, Motion* motion) const {
  for (const Vertex& vertex : vertices_) {
    motion->mass[vertex.id] = mesh.mass[vertex.id];
    for (int k = 0; k < 3; ++k) {
      motion->move[3 * vertex.id + k] += vertex.given[k];
      motion->velocity[3 * vertex.id + k] += vertex.given[k] / timestep;
    }
  }
}

}  // namespace softgym_mj::cloth
