// Contact of flexes with geoms: spheres, capsules, cylinders, ellipsoids and boxes, at rest or moving.

#ifndef SOFTGYM_MJ_CLOTH_SOLIDS_H_
#define SOFTGYM_MJ_CLOTH_SOLIDS_H_

#include <cstdint>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "cloth/plugin/bodies.h"
#include "cloth/plugin/coloring.h"
#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/start.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

// A contact between a geom and a flex in the last step.
struct Contact {
  int geom;
  int vertex[3];  // Of the solver's mesh; those without weight count as none.
  double weight[3];
  double normal[3];  // Towards the flex.
  double force[3];   // On the flex, mean of the step [N].
  double pressure;   // Its part along the normal [N].
};

// Whether a geom and a flex may touch, and with which friction: MuJoCo's rules.
bool MayTouch(const mjModel* m, int geom, const Mesh& mesh, int part);
double Friction(const mjModel* m, int geom, int flex);
// The largest impulse in a substep of h [s] of a body that is told where to go [kg m].
float MostPush(double h);
// "" or what is wrong with a geom that may touch.
std::string CheckGeoms(const mjModel* m, const Mesh& mesh);

class Solids {
 public:
  // Numbers in mjData by which points inside a small body know by which side they have come in.
  static constexpr int kNumSides = 256;

  // Finds what may touch in a step of substeps of h [s]. `sides`: as `KeepSides` left them.
  void Start(const mjModel* m, const mjData* d, const Mesh& mesh, const cloth::Start& start, const mjtNum* qvel,
             const mjtNum* sides, double h);
  void Move();
  // With the number of substeps to the next search, or 0 if this is none.
  void Find(const ClothKernels& kernels, const Points& points, int substeps);
  void Warm(const ClothKernels& kernels, const Points& points, float share);
  void Sweep(const ClothKernels& kernels, const Points& points, const ContactRow& row, SweepPass pass);
  void Finish();

  // How far the fastest vertex moves in the step [m].
  double fastest() const { return fastest_; }
  // Whether a body that gives way may be touched, and whether one of less than 5 kg is among them.
  bool TouchesBodies() const { return touches_bodies_; }
  bool TouchesLightBodies() const { return touches_light_; }
  // Marks the vertices of rows with bodies that give way.
  void MarkNear(std::vector<bool>* near) const;
  // Takes back what of a motion brings vertices into solids that stand still. `Find` has looked from `before` to the
  // motion's end.
  void LiftOut(const Points& points, Motion* motion) const;

  // Whether all rows were found: some are left out where too much is near too many solids.
  bool complete() const { return complete_; }
  Bodies& bodies() { return bodies_; }
  const std::vector<Contact>& contacts() const { return contacts_; }
  // Ends a step: bodies move, contacts are kept.
  void Apply(const mjModel* m, mjData* d, int substeps);
  void KeepSides(mjtNum* sides) const;

 private:
  void Collect(int substeps);

  // What a row is of: three vertices with weights, and a number that only this point of this geom has.
  struct Row {
    int vertex[3];
    float weight[3];
    double key;
  };
  struct Active {
    int geom, body;               // body: in the bodies, or -1.
    bool small;                   // A gripper's pad or something as small, which moves.
    double offset[3], matrix[9];  // From the body's centre, at the start of the step.
    Geom view;
    std::vector<Row> points, triangles;  // Fixed points, and points that are searched.
    std::vector<int> point_order, triangle_order;
    Aligned<SolidBlock> point_blocks, triangle_blocks;
  };

  bool IsFull(const Active& active);
  void AddRows(const Mesh& mesh, Active* active, double margin);
  float SideOf(double key) const;
  void MakeBlocks(const Mesh& mesh, const std::vector<Row>& rows, Active* active, std::vector<int>* order,
                  Aligned<SolidBlock>* blocks);

  const mjModel* m_ = nullptr;
  const mjtNum* sides_ = nullptr;
  std::vector<Active> actives_;
  Bodies bodies_;
  double h_ = 0, fastest_ = 0;
  AlignedFloats position_;
  std::vector<int> body_of_;  // That each vertex is tied to, or -1.
  std::vector<std::uint8_t> counts_;
  Coloring coloring_;
  bool touches_bodies_ = false, touches_light_ = false;
  std::vector<Contact> contacts_;
  size_t num_rows_ = 0;  // Of geoms so far.
  bool complete_ = true;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLIDS_H_
