#include "cloth/plugin/solids.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cloth/plugin/method.h"
#include "cloth/plugin/near.h"

namespace softgym_mj::cloth {
namespace {

// [N] Largest force of a kinematic body, such as a picker, on a point: it passes through cloth that it presses against
// the floor or another body instead of tearing it.
constexpr double kMostForce = 0.1;
constexpr double kShortWay = 0.1;  // [m] Bodies nearer than this are always checked, at any speed.
// Largest number of rows; each takes 150 bytes, or eight times that if many share a vertex. A fast cloth of 40 x 40
// vertices on twenty solids needs as many.
constexpr int kMostRows = 1 << 19;

// Upper bound of the displacement of a moving geom in the step [m].
double FurthestWay(const mjModel* m, const mjData* d, int geom) {
  const int body = m->geom_bodyid[geom];
  const mjtNum* velocity = d->cvel + 6 * body;  // Rotation, then translation of the tree's center of mass.
  mjtNum arm[3], way[3];
  mju_sub3(arm, d->geom_xpos + 3 * geom, d->subtree_com + 3 * m->body_rootid[body]);
  mju_cross(way, velocity, arm);
  mju_addTo3(way, velocity + 3);
  return kShortWay + m->opt.timestep * mju_norm3(way);
}

}  // namespace

float MostPush(double h) { return static_cast<float>(kMostForce * h * h); }

void Solids::Start(const mjModel* m, const mjData* d, const Mesh& mesh, const cloth::Start& start, const mjtNum* qvel,
                   const mjtNum* sides, double h) {
  m_ = m;
  sides_ = sides;
  h_ = h;
  bodies_.Start(m, d, qvel, start.ties, h);
  touches_bodies_ = touches_light_ = false;
  const int count = mesh.NumVertices();
  counts_.assign(count + 1, 1);
  counts_[count] = 0;
  position_.assign(4 * (count + 1), 0);
  body_of_.assign(count, -1);
  for (const Tie& tie : start.ties) body_of_[tie.vertex] = tie.body;
  const double dt = m->opt.timestep;
  double low[3], high[3], fastest = 0;
  for (int k = 0; k < 3; ++k) low[k] = std::numeric_limits<double>::max(), high[k] = -low[k];
  for (int v = 0; v < count; ++v) {
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const double x = start.position[3 * v + k];
      position_[4 * v + k] = static_cast<float>(x);
      low[k] = std::min(low[k], x);
      high[k] = std::max(high[k], x);
      square += start.velocity[3 * v + k] * start.velocity[3 * v + k];
    }
    // The fourth number is the displacement in the step.
    position_[4 * v + 3] = static_cast<float>(dt * std::sqrt(square));
    fastest = std::max(fastest, dt * std::sqrt(square));
  }
  fastest_ = fastest;
  const double radius = *std::max_element(mesh.radius.begin(), mesh.radius.end());
  size_t used = 0;
  num_rows_ = 0;
  complete_ = true;
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_type[g] == mjGEOM_PLANE) continue;
    if (!MayTouchAny(m, g, mesh.materials)) continue;
    double margin = radius + kSolidMargin;
    const double* center = d->geom_xpos + 3 * g;
    // Bodies are checked only if their geoms may be near.
    const auto away = [&](double most) {
      for (int k = 0; k < 3; ++k) {
        if (center[k] + most < low[k] || center[k] - most > high[k]) return true;
      }
      return false;
    };
    const bool moves = m->body_treeid[m->geom_bodyid[g]] >= 0;
    if (away(m->geom_rbound[g] + margin + fastest + (moves ? FurthestWay(m, d, g) : 0))) continue;
    const int body_index = bodies_.Find(m->geom_bodyid[g]);
    const Body* body = body_index < 0 ? nullptr : &bodies_.all()[body_index];
    if (body) {
      const double* v = body->velocity;
      const double turning = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5]);
      margin +=
          dt * (std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turning * m->geom_rbound[g] + kVelocityMargin);
      if (away(m->geom_rbound[g] + margin + fastest)) continue;
    }
    if (actives_.size() <= used) actives_.emplace_back();
    Active& active = actives_[used];
    active.geom = g;
    active.body = body_index;
    active.small = body && body->rigid.is_pushable && m->geom_rbound[g] < kSmall;
    active.view.shape = ShapeOf(m, g);
    active.view.grid = GridOf(m, g);
    CopySize(m, g, active.view.size);
    for (int k = 0; k < 3; ++k) active.offset[k] = center[k] - (body ? body->center[k] : 0);
    mju_copy(active.matrix, d->geom_xmat + 9 * g, 9);
    for (int k = 0; k < 3; ++k) active.view.pose[k] = static_cast<float>(center[k]);
    for (int k = 0; k < 9; ++k) active.view.pose[3 + k] = static_cast<float>(active.matrix[k]);
    AddRows(mesh, &active, margin);
    num_rows_ += active.points.size() + active.triangles.size();
    if (active.points.empty() && active.triangles.empty()) continue;
    MakeBlocks(mesh, active.points, &active, &active.point_order, &active.point_blocks);
    MakeBlocks(mesh, active.triangles, &active, &active.triangle_order, &active.triangle_blocks);
    if (body && body->rigid.is_pushable) {
      touches_bodies_ = true;
      touches_light_ |= body->inverse_mass > 1 / kLight;
    }
    ++used;
  }
  actives_.resize(used);
}

// Whether there is no room for more rows.
bool Solids::IsFull(const Active& active) {
  const bool full = num_rows_ + active.points.size() + active.triangles.size() >= kMostRows;
  complete_ &= !full;
  return full;
}

// Adds rows for all features that may come nearer than `margin`.
void Solids::AddRows(const Mesh& mesh, Active* active, double margin) {
  active->points.clear();
  active->triangles.clear();
  const int dummy = mesh.NumVertices();
  const Geom& view = active->view;
  const float bound = static_cast<float>(m_->geom_rbound[active->geom]);
  const int own = m_->geom_bodyid[active->geom];
  const auto near = [&](const int* vertex, int corners) {
    // Vertices tied to a body do not touch it.
    for (int k = 0; own > 0 && k < corners; ++k) {
      if (body_of_[vertex[k]] == own) return false;
    }
    return ComesNear(position_.data(), vertex, corners, view, bound, static_cast<float>(margin));
  };
  std::vector<bool> touches(mesh.flexes.size());
  for (size_t p = 0; p < mesh.flexes.size(); ++p) touches[p] = MayTouch(m_, active->geom, mesh.materials[p]);
  const double elements = static_cast<double>(dummy + mesh.triangles.size() + mesh.edges.size());
  const auto key = [&](size_t element, int i, int j) {
    return ((active->geom * elements + element) * kMostPoints + i) * kMostPoints + j;
  };
  for (int v = 0; v < dummy; ++v) {
    if (touches[mesh.part[v]] && near(&v, 1) && !IsFull(*active))
      active->points.push_back({{v, dummy, dummy}, {1, 0, 0}, key(v, 0, 0)});
  }
  const auto add = [&](const int* vertex, int corners, double longest, size_t element) {
    if (!touches[mesh.part[vertex[0]]] || !near(vertex, corners) || IsFull(*active)) return;
    const int second = vertex[1], third = corners == 3 ? vertex[2] : dummy;
    if (!active->small && fastest_ < kHasty) {
      active->triangles.push_back({{vertex[0], second, third}, {0, 0, 0}, 0});
      return;
    }
    const int n = static_cast<int>(std::min(std::ceil(longest / kPointDistance), double{kMostPoints}));
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const int k = n - i - j;
        if (i == n || j == n || k == n || (corners == 2 && k > 0)) continue;
        const float scale = 1.0f / n;
        active->points.push_back(
            {{vertex[0], second, third}, {scale * i, scale * j, scale * k}, key(dummy + element, i, j)});
      }
    }
  };
  size_t element = 0;
  for (const Mesh::Triangle& t : mesh.triangles) {
    const double longest =
        std::max({mesh.edges[t.edge[0]].length, mesh.edges[t.edge[1]].length, mesh.edges[t.edge[2]].length});
    add(t.vertex, 3, longest, element++);
  }
  for (const Mesh::Edge& e : mesh.edges) {
    if (e.triangle[0] < 0) add(e.vertex, 2, e.length, element);
    ++element;
  }
}

void Solids::MakeBlocks(const Mesh& mesh, const std::vector<Row>& rows, Active* active, std::vector<int>* order,
                        Aligned<SolidBlock>* blocks) {
  const int dummy = mesh.NumVertices(), count = static_cast<int>(rows.size());
  std::vector<int> vertices(3 * count);
  for (int i = 0; i < count; ++i) std::copy(rows[i].vertex, rows[i].vertex + 3, &vertices[3 * i]);
  coloring_.Order(vertices.data(), count, 3, counts_.data(), dummy + 1, order);
  blocks->resize(order->size() / kBlock);
  for (size_t i = 0; i < order->size(); ++i) {
    SolidBlock& block = (*blocks)[i / kBlock];
    const int lane = i % kBlock, row = (*order)[i];
    block.active = 1;
    block.side[lane] = -2;
    block.rope[lane] = row >= 0 && rows[row].vertex[2] == dummy;
    block.friction[lane] = block.impulse[lane] = block.pressed[lane] = 0;
    block.radius[lane] = row < 0 ? -1e3f : 0;  // Unused lanes touch nothing.
    for (int k = 0; k < 3; ++k) {
      block.vertex[k][lane] = row < 0 ? dummy : rows[row].vertex[k];
      block.weight[k][lane] = row < 0 ? 0 : rows[row].weight[k];
      block.held[k][lane] = block.total[k][lane] = block.arm[k][lane] = 0;
    }
    if (row < 0) continue;
    if (active->small) block.side[lane] = SideOf(rows[row].key);
    const int part = mesh.part[rows[row].vertex[0]];
    block.friction[lane] = static_cast<float>(Friction(m_, active->geom, mesh.flexes[part]));
    block.radius[lane] = static_cast<float>(active->small ? std::min(kThin, mesh.radius[part]) : mesh.radius[part]);
  }
}

Grid Solids::GridOf(const mjModel* m, int geom) const {
  const Shape shape = ShapeOf(m, geom);
  return shape == Shape::kMesh ? grids_[geom]->grid : shape == Shape::kHeights ? HeightsOf(m, geom) : Grid{};
}

void Solids::Move() { bodies_.Move(); }

void Solids::Find(const ClothKernels& kernels, const Points& points, int substeps) {
  for (Active& active : actives_) {
    Rigid* rigid = nullptr;
    if (active.body >= 0) {
      Body& body = bodies_.all()[active.body];
      rigid = &body.rigid;
      PlaceGeom(body.center, body.so_far, active.offset, active.matrix, &active.view);
    }
    kernels.FindSolid(points, position_.data(), active.view, rigid, active.point_blocks.data(),
                      static_cast<int>(active.point_blocks.size()), false, static_cast<float>(substeps));
    kernels.FindSolid(points, position_.data(), active.view, rigid, active.triangle_blocks.data(),
                      static_cast<int>(active.triangle_blocks.size()), true, static_cast<float>(substeps));
  }
}

void Solids::Warm(const ClothKernels& kernels, const Points& points, float share) {
  for (Active& active : actives_) {
    Rigid* rigid = active.body >= 0 ? &bodies_.all()[active.body].rigid : nullptr;
    for (auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
      kernels.WarmSolid(points, blocks->data(), static_cast<int>(blocks->size()), rigid, share);
    }
  }
  bodies_.Share();
}

void Solids::Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass) {
  for (Active& active : actives_) {
    Rigid* rigid = active.body >= 0 ? &bodies_.all()[active.body].rigid : nullptr;
    ContactRow limited = row;
    if (rigid && !rigid->is_pushable) limited.most = MostPush(h_);
    for (auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
      kernels.SweepSolid(points, limited, blocks->data(), static_cast<int>(blocks->size()), rigid, pass);
    }
  }
  bodies_.Share();
}

void Solids::Finish() { bodies_.Finish(); }

void Solids::MarkNear(std::vector<bool>* near) const {
  for (const Active& active : actives_) {
    if (active.body < 0 || !bodies_.all()[active.body].rigid.is_pushable) continue;
    for (const auto* blocks : {&active.point_blocks, &active.triangle_blocks}) {
      for (const SolidBlock& block : *blocks) {
        for (const int* vertex : {block.vertex[0], block.vertex[1], block.vertex[2]}) {
          for (int lane = 0; lane < kBlock; ++lane) (*near)[vertex[lane]] = true;
        }
      }
    }
  }
  near->back() = false;  // The one that stands for none.
}

void Solids::Apply(const mjModel* m, mjData* d, int substeps) {
  bodies_.Apply(m, d, substeps);
  Collect(substeps);
}

}  // namespace softgym_mj::cloth
