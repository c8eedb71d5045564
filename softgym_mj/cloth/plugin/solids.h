// Contact of flexes with geoms: fixed or moving spheres, capsules, cylinders, ellipsoids, boxes and meshes, and
// heightfields.

#ifndef SOFTGYM_MJ_CLOTH_SOLIDS_H_
#define SOFTGYM_MJ_CLOTH_SOLIDS_H_

#include <cstdint>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/bodies.h"
#include "cloth/plugin/coloring.h"
#include "cloth/plugin/geoms.h"
#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// A contact between a geom and a flex in the last step.
struct Contact {
  int geom;
  int vertex[3];  // Vertices of the solver's mesh; those without weight are unused.
  double weight[3];
  double normal[3];  // Direction towards the flex.
  double force[3];   // Mean force on the flex in the step [N].
  double pressure;   // Its normal component [N].
};

// Largest impulse of a kinematic body on a point in a substep of h [s] [kg m].
float MostPush(double h);
class Solids {
 public:
  // Sets up geoms that may touch flexes. Returns "" or an error.
  std::string Reset(const mjModel* m, const std::vector<Material>& materials) {
    return FindGrids(m, materials, &grids_);
  }
  // Finds features that may touch in a step with substeps of h [s]. `sides`: result of `KeepSides`.
  void Start(const mjModel* m, const mjData* d, const Mesh& mesh, const cloth::Start& start, const mjtNum* qvel,
             const mjtNum* sides, double h);
  void Move();
  // Updates rows; `substeps`: number of substeps to the next search, or 0 if this is no search.
  void Find(const ClothKernels& kernels, const Points& points, int substeps);
  void Warm(const ClothKernels& kernels, const Points& points, float share);
  void Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  void Finish();

  // Displacement of the fastest vertex in the step [m].
  double fastest() const { return fastest_; }
  // Whether a dynamic body may be touched, and whether one of them weighs less than 5 kg.
  bool TouchesBodies() const { return touches_bodies_; }
  bool TouchesLightBodies() const { return touches_light_; }
  // Marks the vertices of rows with dynamic bodies.
  void MarkNear(std::vector<bool>* near) const;
  // Removes the part of a motion that brings vertices into fixed solids. `Find` must have searched up to its end.
  void LiftOut(const Points& points, Motion* motion) const;

  // Whether all rows were found: some are left out if too many features are near too many solids.
  bool complete() const { return complete_; }
  // Grid of a mesh that may touch a flex, or of a heightfield; empty for other geoms.
  Grid GridOf(const mjModel* m, int geom) const;
  Bodies& bodies() { return bodies_; }
  const std::vector<Contact>& contacts() const { return contacts_; }
  // Ends a step: moves bodies and stores contacts.
  void Apply(const mjModel* m, mjData* d, int substeps);
  void KeepSides(mjtNum* sides) const;

 private:
  void Collect(int substeps);

  // Vertices of a row with weights, and a key that is unique for this point and geom.
  struct Row {
    int vertex[3];
    float weight[3];
    double key;
  };
  struct Active {
    int geom, body;               // Geom id, and index in the bodies or -1.
    bool small;                   // Whether it is a moving body as small as a gripper's pad.
    double offset[3], matrix[9];  // Pose relative to the body's center at the start of the step.
    Geom view;
    std::vector<Row> points, triangles;  // Rows of fixed points, and of points that are searched.
    std::vector<int> point_order, triangle_order;
    Aligned<SolidBlock> point_blocks, triangle_blocks;
  };

  bool IsFull(const Active& active);
  void AddRows(const Mesh& mesh, Active* active, double margin);
  float SideOf(double key) const;
  void MakeBlocks(const Mesh& mesh, const std::vector<Row>& rows, Active* active, std::vector<int>* order,
                  Aligned<SolidBlock>* blocks);

  const mjModel* m_ = nullptr;
  MeshGrids grids_;
  const mjtNum* sides_ = nullptr;
  std::vector<Active> actives_;
  Bodies bodies_;
  double h_ = 0, fastest_ = 0;
  AlignedFloats position_;
  std::vector<int> body_of_;  // Body to which each vertex is tied, or -1.
  std::vector<std::uint8_t> counts_;
  Coloring coloring_;
  bool touches_bodies_ = false, touches_light_ = false;
  std::vector<Contact> contacts_;
  size_t num_rows_ = 0;  // Rows of geoms so far.
  bool complete_ = true;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLIDS_H_
