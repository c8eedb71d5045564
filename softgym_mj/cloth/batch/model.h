// Model of a batch: the constants of one flex, of grippers, solids and the floor, as bytes that a GPU can read, too.
// Their only pointers are those of grids. Arrays of nodes follow the bytes until a batch has stored each once.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_
#define SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_

#include "cloth/plugin/kernels.h"

namespace softgym_mj::cloth {

// A geom that pushes the flex.
struct Solid {
  Shape shape;
  float size[3];  // As in mjModel [m].
  float friction;
  int geom, body;    // Its id in mjModel, or -1 for a gripper that only holds, and the index of its body.
  int is_static;     // 1 for a solid on a body without joints.
  double bound;      // Bounding radius [m].
  double center[3];  // Center of mass of its body, in its own frame [m].
};

// Arrays follow this struct, at offsets `*_at` [bytes] from its start, aligned to 32 bytes.
struct Model {
  int size;                                // Total size [bytes].
  int is_surface;                          // 1 for a surface, 0 for a rope.
  int vertices, padded, triangles, edges;  // `padded`: number of vertices in Points.
  int edge_blocks, edge_colors, hinge_blocks, hinge_colors, chains, chain_edges;
  int bend_interval, substeps, takes_air;
  int has_slim;                  // As in Mesh.
  int grippers, solids, bodies;  // `bodies`: one for each gripper, then those of solids.
  int static_solids;             // Number of solids on bodies without joints.
  int sweeps;                    // Sweeps over contacts near dynamic bodies per substep.
  int points;                    // Room for fixed contact points of a small solid.
  int candidates, found, rows;   // Room for candidates of each kind, for pairs that may touch, and for rows.
  double timestep, h;            // [s]
  double gravity[3];             // [m/s^2]
  ContactRow contact, plane_row, solid_row;
  float thickness, friction;  // Layers: largest thickness [m], friction coefficient.
  double radius, density;     // [m], [kg/m^2]
  double drag, added_mass;    // As in Material.
  double twist;               // Moment per twist angle [N m], of the only chain; 0 disables twist.
  int twist_ring, twist_clamped;
  double plane_point[3], plane_normal[3];
  float plane_friction;

  // (vertices, 3) [m] where slides are 0; (vertices,) 1 / their masses [1/kg], and their masses [kg].
  int origin_at, inverse_mass_at, mass_at;
  int vertex_thickness_at;  // (vertices,) Thickness of vertices [m].
  // Rows of edges and hinges as they are at rest, the edge of each lane or -1, and the first block of each color.
  int edge_blocks_at, edge_order_at, edge_colors_at;
  int stiffening_at;  // (edge_blocks,) `StiffeningBlock`; 0 if no edge stiffens.
  int hinge_blocks_at, hinge_order_at, hinge_colors_at;
  // Triangles and lanes of edge blocks at each vertex, in order: first indices, and the lists.
  int triangles_of_at, triangle_of_at, lanes_of_at, lane_of_at;
  // (triangles, 3) corners, their areas [m^2], owned features; (edges, 2) ends and triangles. As in Mesh.
  int triangle_vertex_at, triangle_area_at, triangle_owned_at, edge_vertex_at, edge_triangle_at;
  // (edges,) chain of each edge, or -1, and index in it; (vertices,) rope edge that owns each vertex.
  int chain_at, place_at, owner_at;
  int part_at;  // (vertices,) Index of the flex: zeros.
  // (chains + 1,) first edge of each chain; (chain_edges + chains,) vertices and (chain_edges,) edges along them, and
  // constants of their rows (ChainRows).
  int chain_first_at, chain_vertex_at, chain_edge_at, chain_length_at, chain_gamma_at, chain_keep_at;
  // Vertices, triangles and edges in spatial order at rest; -1 fills the last eight.
  int vertex_order_at, triangle_order_at, edge_order_by_place_at;
  int vertex_leaves, triangle_leaves, edge_leaves;
  int longest_at;                  // (triangles or rope edges,) Longest edge at rest [m], of doubles.
  int trees_at;                    // (bodies,) Kinematic tree of each body; bodies of one tree push each other.
  int solids_at, first_solids_at;  // (grippers + solids,) `Solid`; (bodies,) the first one of each body.
  int order_at;                    // (grippers + solids,) Indices in the order of their geoms, in which they push.
  int grids_at, nodes_of_at;       // (grippers + solids,) `Grid`, and the index of its nodes, or -1.

  template <class T>
  const T* At(int place) const {
    return reinterpret_cast<const T*>(reinterpret_cast<const char*>(this) + place);
  }
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_MODEL_H_
