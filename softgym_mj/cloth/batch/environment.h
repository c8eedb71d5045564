// One environment of a batch: its state, the inputs of a step, and the memory of a step.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_ENVIRONMENT_H_
#define SOFTGYM_MJ_CLOTH_BATCH_ENVIRONMENT_H_

#include "batch/group.h"
#include "batch/memory.h"
#include "cloth/batch/model.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/method.h"
#include "cloth/plugin/rigid.h"

namespace softgym_mj::cloth {

// Limits of colors: of layer rows, and of rows of a mesh, whose vertices have few neighbors.
constexpr int kMostColors = 384, kMeshColors = 128;
constexpr int kKeptPairs = 2;  // Pairs that are stored per vertex for the next step (Kept).

// Failures of a step as bits: a state that is not finite, or too little room, so that contacts were left out.
enum Flag { kNotFinite = 1, kCandidatesFull = 2, kPairsFull = 4, kRowsFull = 8, kColorsFull = 16 };

// Rows by graph color: rows of one color have no vertex in common.
struct Rows {
  int count, blocks, colors;  // Numbers of rows, of blocks of eight rows, of colors.
  int room;                   // Largest number of colors.
  Key* key;                   // Sort key of each row; keys are unique.
  int* vertex;                // (count, corners)
  int* color;                 // Color of each row.
  int* order;                 // Row of each lane of the blocks, or -1.
  int begin[kMostColors + 1], filled[kMostColors];
};

// Blocks of near layer rows with an impulse in this substep, by color: only they are swept again.
struct PushingBlocks {
  int* pushes;  // (blocks,) Whether a block has an impulse.
  int* block;   // Those blocks, in order.
  int begin[kMostColors + 1], colors;
};

// A gripper, or a body of solids, during a step; as `Body` of the plugin.
struct Mover {
  Rigid rigid;
  int tree, touched;
  double inverse_mass;
  double impulse[6], moved[6];
  const double *jacobian, *response;
  double center[3];  // Center of mass at the start of the step [m].
  Displacement so_far;
  double acceleration[6];
};

// Contact of one gripper or solid.
struct Touch {
  Geom geom;
  double offset[3], matrix[9];  // Pose relative to the center of mass at the start of the step.
  // Whether it is small, has fixed contact points on elements, and may push a body that gives way.
  int small, fixed, pushes;
  int room;  // Largest number of rows of points.
  Rows points, triangles;
  float* weight;  // (room, 3) Weights of points, and keys (room,) of their entry faces; null for grippers.
  double* key;
  int* rank;  // (room,) Rank of each point in its element; null for grippers.
  SolidBlock *point_blocks, *triangle_blocks, **active;
  int num_active;  // Blocks of a body that gives way that may touch before the next search, in their order.
};

// Scalars of a step.
struct Step {
  int flags, remaining, num_driven, num_kept, num_near;
  int num_candidates[2];  // Vertices and triangles, edges and edges.
  int num_found, num_pairs;
  int covers;       // Whether the candidates are valid,
  int left;         // whether a vertex has left its box,
  const Model* of;  // and the mesh of the candidates.
  int moves, changed, lifted;
  float furthest;
  double fastest, mean[3];
  // Whether bodies that give way may be touched, also light ones, and whether rows near them are swept repeatedly.
  int touches_bodies, touches_light, repeats;
  int num_sides;
  double low[3], high[3];  // Box around the vertices [m].
  Rows layers, near_layers[2];
  PushingBlocks pushing[2];  // Of near layers.
};

struct Environment {
  const Model* model;
  // Inputs: targets of grippers (grippers, 3) [m], the vertex that each holds or a negative number, and goals of these
  // vertices (grippers, 3) [m].
  const double *targets, *goals;
  const int* held;
  // Solids: poses (solids, 7), velocities of the centers of mass of their bodies (solids, 6), their accelerations,
  // Jacobians of these (solids, 6, dofs) and responses of the degrees of freedom to impulses (solids, dofs, 6), and
  // whether they touch the flex.
  const double *poses, *velocities, *accelerations, *jacobians, *responses;
  const int* touching;
  int dofs;
  // Outputs: mean force and torque on each solid in the step (solids, 6), and impulses on its body (solids, 2, 6).
  double *solid_forces, *solid_impulses;
  double* pushes;  // (solids, pushed) Least component of contact normals along the solid's y axis, by vertex; or null.
  int pushed;
  double* sides;  // State: entry faces (kNumSides,) of points inside small solids.

  // State: `valid` is 1 once the other arrays are valid (Kept). Grippers (grippers, 3) [m], [m/s].
  double *valid, *qpos, *qvel, *reference, *after_edge, *holding_force, *after_layers;
  double *gripper_qpos, *gripper_qvel, *twist;

  // Kept between steps: boxes of vertices, and candidates as long as these suffice.
  Step* step;
  float *low, *high;
  int *triangle_candidates, *edge_candidates;

  // Scratch memory.
  Points points;
  float *with_layers, *position, *move, *end, *solid_position;
  double *start, *velocity, *acceleration, *drag, *later, *motion, *speed, *mass, *forces, *sum;
  float *inverse_mass, *yielding;
  int *driven, *head, *next, *zone, *near, *touches, *plane_near;
  float *place, *plane_gap, *plane_friction;
  double* given;
  EdgeBlock* edges;
  HingeBlock* hinges;
  float *chain_start, *chain_before, *chain_impulse, *chain_way;
  double *chain_lower, *chain_diagonal, *chain_right, *chain_normal;
  double *twist_way, *twist_next, *twist_change, *twist_pull;  // As in TwistRow.
  Boxes *vertex_boxes, *triangle_boxes, *edge_boxes;           // Boxes of items in leaves of eight.
  Boxes *vertex_leaves, *triangle_leaves, *edge_leaves;        // Boxes of leaves.
  float* normals;
  Pair *found, *pairs;
  LayerBlock *layers, *near_layers[2];
  // Pairs: group, and the pair of each row of a group; vertices: whether they are near bodies that give way.
  int *group, *pair_of, *near_vertex, *next_near, *plane_repeats;
  float* plane_impulse;
  double* found_sides;
  Key* best;
  Key* taken;
  Mover* bodies;
  Touch* touch;
};

// Number of solids, and whether bodies that give way may be touched in this step.
inline int Solids(const Model& m) { return kSolids ? m.solids : 0; }
inline bool TouchesBodies(const Environment& w) { return kSolids && w.step->touches_bodies; }

inline int Blocks(int rows, int colors) { return (rows + kBlock - 1) / kBlock + colors; }

// Allocates memory for at most `most` rows of at most `colors` colors; `rows` is null if memory is only counted.
// Pointers are written one by one: NVRTC 13.0 loses writes through a pointer to either of two places.
inline void TakeRows(Memory* memory, int most, int corners, int colors, Rows* rows) {
  Key* key;
  int *vertex, *color, *order;
  memory->Take(&key, most);
  memory->Take(&vertex, corners * most);
  memory->Take(&color, most);
  memory->Take(&order, kBlock * Blocks(most, colors));
  if (!rows) return;
  rows->room = colors;
  rows->key = key, rows->vertex = vertex, rows->color = color, rows->order = order;
}

// Allocates memory that is kept from a step to the next.
inline void TakeKept(const Model& model, Memory* memory, Environment* w) {
  memory->Take(&w->step, 1);
  memory->Take(&w->low, 4 * model.padded);
  memory->Take(&w->high, 4 * model.padded);
  memory->Take(&w->triangle_candidates, 2 * model.candidates);
  memory->Take(&w->edge_candidates, 2 * model.candidates);
}

// Allocates memory for rows near bodies that give way.
inline void TakeNear(const Model& model, Memory* memory, Environment* w) {
  memory->Take(&w->group, model.rows);
  memory->Take(&w->pair_of, 3 * model.rows);
  memory->Take(&w->near_vertex, model.padded);
  memory->Take(&w->next_near, model.padded);
  memory->Take(&w->plane_repeats, model.padded / kBlock);
  memory->Take(&w->plane_impulse, 4 * model.padded);
  memory->Take(&w->found_sides, (model.points + model.vertices) * model.solids);
  for (int g = 0; g < 2; ++g) {
    TakeRows(memory, model.rows, 4, kMostColors, w->step ? &w->step->near_layers[g] : nullptr);
    LayerBlock* blocks;
    int *pushes, *block;
    memory->Take(&blocks, Blocks(model.rows, kMostColors));
    memory->Take(&pushes, Blocks(model.rows, kMostColors));
    memory->Take(&block, Blocks(model.rows, kMostColors));
    w->near_layers[g] = blocks;
    if (w->step) w->step->pushing[g].pushes = pushes, w->step->pushing[g].block = block;
  }
}

// Allocates memory for the rows of a gripper or solid.
inline void TakeTouch(const Model& model, bool solid, Memory* memory, Touch* touch) {
  const int n = model.vertices + (solid ? model.points : 0), colors = solid ? kMostColors : kMeshColors;
  const int elements = model.is_surface ? model.triangles : model.edges;
  float* weight;
  double* key;
  int* rank;  // (room,) Rank of each point in its element; null for grippers.
  SolidBlock *point_blocks, *triangle_blocks, **active;
  TakeRows(memory, n, 3, colors, touch ? &touch->points : nullptr);
  TakeRows(memory, elements, 3, kMeshColors, touch ? &touch->triangles : nullptr);
  memory->Take(&weight, solid ? 3 * n : 0);
  memory->Take(&key, solid ? n : 0);
  memory->Take(&rank, solid ? n : 0);
  memory->Take(&point_blocks, Blocks(n, colors));
  memory->Take(&triangle_blocks, Blocks(elements, kMeshColors));
  memory->Take(&active, solid ? Blocks(n, colors) + Blocks(elements, kMeshColors) : 0);
  if (!touch) return;
  touch->room = n;
  touch->weight = weight, touch->key = key, touch->rank = rank;
  touch->point_blocks = point_blocks, touch->triangle_blocks = triangle_blocks;
  touch->active = active;
}

// Allocates scratch memory, which contains `Rows` themselves, too.
inline void TakeMemory(const Model& model, Memory* memory, Environment* w) {
  const int n = model.vertices, p = 4 * model.padded, e = model.chain_edges;
  const int touches = model.grippers + model.solids;
  memory->Take(&w->bodies, model.bodies);
  memory->Take(&w->touch, touches);
  float** const of_points[] = {&w->points.now,       &w->points.before, &w->points.drift, &w->points.bent_drift,
                               &w->points.predicted, &w->points.moved,  &w->points.air,   &w->with_layers,
                               &w->position,         &w->move,          &w->end,          &w->solid_position};
  for (float** a : of_points) memory->Take(a, p);
  w->points.count = model.padded;
  double** const of_vertices[] = {&w->start,  &w->velocity, &w->acceleration, &w->later,
                                  &w->motion, &w->speed,    &w->forces};
  for (double** a : of_vertices) memory->Take(a, 3 * n);
  memory->Take(&w->drag, 4 * model.triangles);
  memory->Take(&w->mass, n);
  memory->Take(&w->sum, 8 * n);
  memory->Take(&w->inverse_mass, model.padded);
  memory->Take(&w->yielding, model.padded);
  memory->Take(&w->plane_gap, model.padded);
  memory->Take(&w->plane_friction, model.padded);
  memory->Take(&w->plane_near, model.padded / kBlock);
  memory->Take(&w->touches, n);
  memory->Take(&w->zone, n);
  memory->Take(&w->driven, model.grippers);
  memory->Take(&w->place, 3 * model.grippers);
  memory->Take(&w->given, 3 * model.grippers);
  memory->Take(&w->head, n + model.edges);
  memory->Take(&w->next, kKeptPairs * n);
  memory->Take(&w->edges, model.edge_blocks);
  memory->Take(&w->hinges, model.hinge_blocks);
  memory->Take(&w->chain_before, e);
  memory->Take(&w->chain_impulse, e);
  memory->Take(&w->chain_start, 3 * e);
  memory->Take(&w->chain_way, 3 * e);
  memory->Take(&w->chain_lower, e);
  memory->Take(&w->chain_diagonal, e);
  memory->Take(&w->chain_right, e);
  memory->Take(&w->chain_normal, 3 * e);
  const int twisted = model.twist > 0 ? e : 0;
  memory->Take(&w->twist_way, 3 * twisted);
  memory->Take(&w->twist_next, 3 * twisted);
  memory->Take(&w->twist_change, twisted);
  memory->Take(&w->twist_pull, 3 * twisted);
  memory->Take(&w->vertex_boxes, model.vertex_leaves);
  memory->Take(&w->triangle_boxes, model.triangle_leaves);
  memory->Take(&w->edge_boxes, model.edge_leaves);
  memory->Take(&w->vertex_leaves, model.vertex_leaves / kBlock + 1);
  memory->Take(&w->triangle_leaves, model.triangle_leaves / kBlock + 1);
  memory->Take(&w->edge_leaves, model.edge_leaves / kBlock + 1);
  memory->Take(&w->normals, 3 * model.triangles);
  memory->Take(&w->found, model.found);
  memory->Take(&w->near, model.found);
  memory->Take(&w->pairs, model.rows);
  memory->Take(&w->layers, Blocks(model.rows, kMostColors));
  memory->Take(&w->best, model.padded);
  memory->Take(&w->taken, kMostColors / 64 * model.padded);
  TakeRows(memory, model.rows, 4, kMostColors, w->step ? &w->step->layers : nullptr);
  if (model.solids > 0) TakeNear(model, memory, w);
  for (int t = 0; t < touches; ++t) TakeTouch(model, t >= model.grippers, memory, w->touch ? w->touch + t : nullptr);
}

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_ENVIRONMENT_H_
