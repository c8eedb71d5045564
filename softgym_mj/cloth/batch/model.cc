// Converts a compiled mjModel to a `Model`.

#include "cloth/batch/model.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/batch/model_solids.h"
#include "cloth/plugin/workspace.h"
#include "native/export.h"

namespace softgym_mj::cloth {
namespace {

constexpr int kAlign = 32;
// Room for pairs and rows per vertex; a pile of 20 x 20 vertices has 7 and 3.
constexpr int kCandidatesOfVertex = 64, kFoundOfVertex = 48, kRowsOfVertex = 12;
constexpr int kPointsOfSolid = 4096;    // A pad in a pile of four layers has some 2000.
constexpr int kMostVertices = 1 << 13;  // Keys of pairs have 15 and 16 bits for their items.
constexpr int kMostBytes = 1 << 30;     // Its size is an int.

class Writer {
 public:
  explicit Writer(std::string* out) : out_(out) {}
  template <class V>
  int operator()(const V& values) {
    out_->resize((out_->size() + kAlign - 1) / kAlign * kAlign);
    const int at = static_cast<int>(out_->size());
    out_->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
    return at;
  }

 private:
  std::string* out_;
};

// Returns the first block of each color: a block that shares a vertex with an earlier one of its color begins the next
// color. `shared` is the vertex that fills empty lanes.
template <class Block, int corners>
std::vector<int> Coloring(const Aligned<Block>& blocks, int vertices, int shared) {
  std::vector<int> begins = {0}, color_of(vertices + 1, -1);
  for (size_t b = 0; b < blocks.size(); ++b) {
    const auto each = [&](const auto& f) {
      for (int k = 0; k < corners; ++k) {
        for (int lane = 0; lane < kBlock; ++lane) {
          if (blocks[b].vertex[k][lane] != shared) f(blocks[b].vertex[k][lane]);
        }
      }
    };
    const int color = static_cast<int>(begins.size());
    bool clash = false;
    each([&](int v) { clash |= color_of[v] == color; });
    if (clash) begins.push_back(static_cast<int>(b));
    each([&](int v) { color_of[v] = static_cast<int>(begins.size()); });
  }
  begins.push_back(static_cast<int>(blocks.size()));
  return begins;
}

// Lists for each vertex the items of which it is a corner, in order.
void Invert(const std::vector<int>& corners, int of_item, int vertices, std::vector<int>* first,
            std::vector<int>* items) {
  first->assign(vertices + 1, 0);
  for (int v : corners) {
    if (v >= 0) ++(*first)[v + 1];
  }
  for (int v = 0; v < vertices; ++v) (*first)[v + 1] += (*first)[v];
  items->resize(first->back());
  std::vector<int> place(first->begin(), first->end() - 1);
  for (size_t i = 0; i < corners.size(); ++i) {
    if (corners[i] >= 0) (*items)[place[corners[i]]++] = static_cast<int>(i) / of_item;
  }
}

std::string Write(const mjModel* m, const Workspace& w, const std::vector<int>& geoms, int grippers, double room,
                  std::string* out) {
  const Mesh& mesh = w.mesh;
  const int count = mesh.NumVertices();
  if (mesh.flexes.size() != 1) return "expected one flex.";
  if (count > kMostVertices) return "expected at most " + std::to_string(kMostVertices) + " vertices.";
  Model model = {};
  const Material& material = mesh.materials[0];
  model.is_surface = m->flex_dim[mesh.flexes[0]] == 2;
  model.vertices = count;
  model.padded = (count + 1 + kBlock - 1) / kBlock * kBlock;
  model.triangles = static_cast<int>(mesh.triangles.size());
  model.edges = static_cast<int>(mesh.edges.size());
  model.candidates = static_cast<int>(room * kCandidatesOfVertex * count);
  model.found = static_cast<int>(room * kFoundOfVertex * count);
  model.rows = static_cast<int>(room * kRowsOfVertex * count);
  model.timestep = m->opt.timestep;
  model.h = w.solver.substep();
  model.substeps = w.settings.substeps;
  mju_copy3(model.gravity, m->opt.gravity);
  model.contact = w.solver.contact();
  model.plane_row = w.solver.plane_row();
  model.solid_row = w.solver.contact();
  model.solid_row.most = MostPush(w.solver.substep());
  model.thickness = mesh.thickness[0];
  model.has_slim = mesh.has_slim;
  model.friction = mesh.friction[0];
  model.radius = mesh.radius[0];
  model.density = mesh.density[0];
  model.drag = material.drag;
  model.added_mass = material.added_mass;
  model.takes_air = material.added_mass > 0;
  if (w.planes.size() != 1 || !w.planes[0].touches[0]) return "expected one plane, the floor.";
  mju_copy3(model.plane_point, w.planes[0].point);
  mju_copy3(model.plane_normal, w.planes[0].normal);
  model.plane_friction = w.planes[0].friction[0];
  std::vector<Solid> solids;
  std::vector<int> first_solids, trees;
  const std::string wrong = FillSolids(m, mesh, geoms, grippers, &solids, &first_solids, &trees);
  if (!wrong.empty()) return wrong;
  model.grippers = grippers;
  model.solids = static_cast<int>(geoms.size()) - grippers;
  model.bodies = static_cast<int>(first_solids.size());
  for (const Solid& solid : solids) model.static_solids += solid.is_static;
  model.sweeps = w.settings.sweeps;
  model.points = static_cast<int>(room * kPointsOfSolid);

  out->assign(sizeof(Model), 0);
  Writer write(out);
  std::vector<double> origin(3 * count);
  std::vector<float> inverse_mass(model.padded, 0.0f);
  for (int v = 0; v < count; ++v) {
    if (w.vertices[v].dof < 0) return "expected free vertices.";
    mju_copy3(&origin[3 * v], m->body_pos + 3 * w.vertices[v].body);
    inverse_mass[v] = static_cast<float>(1 / mesh.mass[v]);
  }
  model.origin_at = write(origin);
  model.inverse_mass_at = write(inverse_mass);
  model.mass_at = write(mesh.mass);
  model.vertex_thickness_at = write(mesh.vertex_thickness);

  const EdgeRows& edges = w.solver.edges();
  const HingeRows& hinges = w.solver.hinges();
  const std::vector<int> edge_colors = Coloring<EdgeBlock, 2>(edges.blocks(), count, count);
  const std::vector<int> hinge_colors = Coloring<HingeBlock, 4>(hinges.blocks(), count, count);
  model.edge_blocks = static_cast<int>(edges.blocks().size());
  model.edge_colors = model.edge_blocks ? static_cast<int>(edge_colors.size()) - 1 : 0;
  model.hinge_blocks = static_cast<int>(hinges.blocks().size());
  model.hinge_colors = model.hinge_blocks ? static_cast<int>(hinge_colors.size()) - 1 : 0;
  model.bend_interval = hinges.interval();
  model.edge_blocks_at = write(edges.blocks());
  model.stiffening_at = edges.stiffening().empty() ? 0 : write(edges.stiffening());
  model.edge_order_at = write(edges.order());
  model.edge_colors_at = write(edge_colors);
  model.hinge_blocks_at = write(hinges.blocks());
  model.hinge_order_at = write(hinges.order());
  model.hinge_colors_at = write(hinge_colors);

  std::vector<int> corners, ends, sides, owned, lanes(2 * edges.order().size(), -1), first, items;
  std::vector<double> area, longest;
  for (const Mesh::Triangle& t : mesh.triangles) {
    corners.insert(corners.end(), t.vertex, t.vertex + 3);
    area.push_back(t.area);
    owned.push_back(t.owned);
    longest.push_back(
        std::max({mesh.edges[t.edge[0]].length, mesh.edges[t.edge[1]].length, mesh.edges[t.edge[2]].length}));
  }
  for (const Mesh::Edge& e : mesh.edges) {
    ends.insert(ends.end(), e.vertex, e.vertex + 2);
    sides.insert(sides.end(), e.triangle, e.triangle + 2);
    if (!model.is_surface) longest.push_back(e.length);
  }
  for (size_t i = 0; i < edges.order().size(); ++i) {
    if (edges.order()[i] < 0) continue;
    for (int k = 0; k < 2; ++k) lanes[2 * i + k] = mesh.edges[edges.order()[i]].vertex[k];
  }
  Invert(corners, 3, count, &first, &items);
  model.triangles_of_at = write(first);
  model.triangle_of_at = write(items);
  Invert(lanes, 2, count, &first, &items);
  model.lanes_of_at = write(first);
  model.lane_of_at = write(items);
  model.triangle_vertex_at = write(corners);
  model.triangle_area_at = write(area);
  model.triangle_owned_at = write(owned);
  model.edge_vertex_at = write(ends);
  model.edge_triangle_at = write(sides);

  const Layers& layers = w.solver.layers();
  model.chain_at = write(layers.chain());
  model.place_at = write(layers.place());
  model.owner_at = write(layers.owner());
  model.part_at = write(mesh.part);
  std::vector<int> chain_first = {0}, chain_vertex, chain_edge;
  std::vector<float> length, gamma, keep;
  for (const ChainRows::Row& row : w.solver.chains().rows()) {
    chain_vertex.insert(chain_vertex.end(), row.vertex.begin(), row.vertex.end());
    chain_edge.insert(chain_edge.end(), row.edge.begin(), row.edge.end());
    length.insert(length.end(), row.length.begin(), row.length.end());
    gamma.insert(gamma.end(), row.gamma.begin(), row.gamma.end());
    keep.insert(keep.end(), row.keep.begin(), row.keep.end());
    chain_first.push_back(static_cast<int>(chain_edge.size()));
  }
  model.chains = static_cast<int>(chain_first.size()) - 1;
  model.chain_edges = static_cast<int>(chain_edge.size());
  for (const TwistRows::Rope& rope : w.solver.twists().ropes()) {
    model.twist = rope.stiffness;
    model.twist_ring = rope.is_ring;
    model.twist_clamped = rope.is_clamped;
  }
  model.chain_first_at = write(chain_first);
  model.chain_vertex_at = write(chain_vertex);
  model.chain_edge_at = write(chain_edge);
  model.chain_length_at = write(length);
  model.chain_gamma_at = write(gamma);
  model.chain_keep_at = write(keep);

  model.longest_at = write(longest);
  model.trees_at = write(trees);
  model.solids_at = write(solids);
  std::vector<int> pushing(geoms.size());
  std::iota(pushing.begin(), pushing.end(), 0);
  std::stable_sort(pushing.begin(), pushing.end(), [&](int a, int b) { return geoms[a] < geoms[b]; });
  model.order_at = write(pushing);
  model.first_solids_at = write(first_solids);
  const SolidGrids grids = GridsOf(m, w.solids, solids);
  model.grids_at = write(grids.grids);
  model.nodes_of_at = write(grids.nodes_of);
  model.vertex_order_at = write(layers.vertex_order());
  model.triangle_order_at = write(layers.triangle_order());
  model.edge_order_by_place_at = write(layers.edge_order());
  model.vertex_leaves = static_cast<int>(layers.vertex_order().size()) / kBlock;
  model.triangle_leaves = static_cast<int>(layers.triangle_order().size()) / kBlock;
  model.edge_leaves = static_cast<int>(layers.edge_order().size()) / kBlock;
  out->resize((out->size() + kAlign - 1) / kAlign * kAlign);
  model.size = static_cast<int>(out->size());
  std::memcpy(&(*out)[0], &model, sizeof(Model));
  for (size_t i = 0; i < grids.nodes.size(); ++i) {
    if (out->size() + grids.sizes[i] > kMostBytes) return "expected meshes and heightfields of at most 1 GB.";
    out->append(reinterpret_cast<const char*>(grids.nodes[i]), grids.sizes[i]);
  }
  return "";
}

}  // namespace
}  // namespace softgym_mj::cloth

// Writes the Model of a compiled mjModel and nodes of grids, up to `capacity` bytes; mjData must have made a step.
// `ids`: geom ids of grippers, or -1 for one that only holds, then -2 - id of solids. `room` scales the room for
// contacts. Returns the size in bytes, or 0 after writing a message to `error`.
SGM_EXPORT int softgym_mj_cloth_batch_model(const mjModel* m, const mjData* d, const int* ids, int num_ids, double room,
                                            char* out, int capacity, char* error, int error_size) {
  using namespace softgym_mj::cloth;
  int instance;
  const Workspace* w = FindWorkspace(m, d, &instance);
  std::string bytes;
  std::vector<int> geoms(ids, ids + num_ids);
  int grippers = 0;
  for (int& id : geoms) id >= -1 ? ++grippers : id = -2 - id;
  const std::string wrong = w ? Write(m, *w, geoms, grippers, room, &bytes) : "no flex carries the plugin.";
  std::snprintf(error, error_size, "%s", wrong.c_str());
  if (!wrong.empty()) return 0;
  std::memcpy(out, bytes.data(), std::min<size_t>(bytes.size(), capacity));
  return static_cast<int>(bytes.size());
}
