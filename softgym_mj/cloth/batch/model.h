// What a batch has to know of one flex, its grippers and the floor: all that does not change in an episode, as bytes
// without pointers, so that a GPU can read it as well.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_
#define SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {

// Arrays lie behind this, each `*_at` bytes from its start, on 32 bytes.
struct Model {
  int size;                                // Bytes in all.
  int is_surface;                          // Or a rope.
  int vertices, padded, triangles, edges;  // `padded`: see Points.
  int edge_blocks, edge_colors, hinge_blocks, hinge_colors, chains, chain_edges;
  int bend_interval, substeps, takes_air;
  int has_slim;  // See Mesh.
  int grippers;
  int candidates, found, rows;  // Places for candidates of each kind, for pairs that may touch, and for their rows.
  double timestep, h;           // [s]
  double gravity[3];            // [m/s^2]
  ContactRow contact, plane_row, gripper_row;
  float thickness, friction;  // Of layers; the largest thickness there is [m].
  double radius, density;     // [m], [kg/m^2]
  double drag, added_mass;    // See Material.
  double plane_point[3], plane_normal[3];
  float plane_friction, gripper_friction, gripper_radius;

  // (vertices, 3) [m] where slides are 0; (vertices,) 1 / their masses [1/kg], and their masses [kg].
  int origin_at, inverse_mass_at, mass_at;
  int vertex_thickness_at;  // (vertices,) See Mesh [m].
  // Rows of edges and hinges as they are at rest, the edge of each lane or -1, and the first block of each color.
  int edge_blocks_at, edge_order_at, edge_colors_at;
  int hinge_blocks_at, hinge_order_at, hinge_colors_at;
  // Of each vertex, the triangles it is a corner of, and the lanes of edges it is an end of, in order: where they
  // begin, and what they are.
  int triangles_of_at, triangle_of_at, lanes_of_at, lane_of_at;
  // (triangles, 3) corners, their areas [m^2], what they own; (edges, 2) ends and triangles. See Mesh.
  int triangle_vertex_at, triangle_area_at, triangle_owned_at, edge_vertex_at, edge_triangle_at;
  // (edges,) the chain that each belongs to, or -1, and where in it; (vertices,) the edge of a rope that owns each.
  int chain_at, place_at, owner_at;
  int part_at;  // (vertices,) zeros: which flex they are of.
  // (chains + 1,) the first edge of each; (chain_edges + chains,) vertices and (chain_edges,) edges along them, and
  // what the rows of these are. See ChainRows.
  int chain_first_at, chain_vertex_at, chain_edge_at, chain_length_at, chain_gamma_at, chain_keep_at;
  // Vertices, triangles and edges in an order in which what is near at rest has near places; -1 fills the last eight.
  int vertex_order_at, triangle_order_at, edge_order_by_place_at;
  int vertex_leaves, triangle_leaves, edge_leaves;

  template <class T>
  const T* At(int place) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(this) + place);
  }
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_
