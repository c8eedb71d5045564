// A step of all flexes: substeps of elasticity, contact and friction in one solve.

#ifndef SOFTGYM_MJ_CLOTH_SOLVER_H_
#define SOFTGYM_MJ_CLOTH_SOLVER_H_

#include <cstdint>
#include <vector>

#include "cloth/plugin/impacts.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/layers.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/solids.h"
#include "cloth/plugin/start.h"
#include "cloth/plugin/state.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

struct Settings {
  int substeps = 25;
  int sweeps = 15;                  // Over contacts near bodies that give way, in each substep.
  double contact_stiffness = 2000;  // [N/m] Of a contact,
  double contact_damping = 0.01;    // [s] and its dashpot as a multiple of it.
};

class Solver {
 public:
  // To be called when the mesh, the settings or the time step [s] have changed.
  void Reset(const Mesh& mesh, const Settings& settings, double timestep);

  // Moves the vertices by a step; `motion` holds their displacements and final velocities.
  void Step(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes, Solids* solids,
            const Kept& kept, Motion* motion);

  double substep() const { return h_; }
  const Layers& layers() const { return layers_; }

 private:
  // Edges of a cord, solved at once.
  struct ChainRow {
    std::vector<int> vertex, edge;
    std::vector<float> start, length, gamma, keep, before, impulse;
    std::vector<double> lower, diagonal, right, normal;
  };
  struct ActivePlane {
    float normal[3];
    AlignedFloats gap, friction, impulse;
    std::vector<int> blocks, near_blocks;  // Those that may touch, and that bodies push.

    Plane View(const std::vector<int>& some);
    Plane Far() { return View(blocks); }
    Plane Near() { return View(near_blocks); }
  };

  void StartPoints(const Mesh& mesh, const Start& start);
  void StartEdges(const Start& start, const double* after);
  void StartHinges(const Start& start);
  void StartPlanes(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes);
  void FindLayers(const Mesh& mesh, const Start& start, const Solids& solids, const Kept& kept);
  void Substep(int substep, Solids* solids);
  void SolveChain(ChainRow* chain);
  void AddHoldingForces(const Mesh& mesh);
  void AddDrag(const Mesh& mesh, const Start& start, std::vector<double>* acceleration) const;
  void StartAir(const Mesh& mesh, const Start& start);
  void Finish(const Mesh& mesh, const Start& start, Motion* motion);
  void Keep(int count, const Kept& kept) const;
  void StayAbovePlanes(const Start& start, Motion* motion) const;

  const ClothKernels* kernels_ = nullptr;
  Settings settings_;
  double timestep_ = 0, h_ = 0;
  ContactRow contact_ = {}, plane_row_ = {};
  Points points_ = {};
  AlignedFloats now_, before_, drift_, bent_drift_, predicted_, moved_, air_;
  AlignedFloats with_layers_;  // What `now_` was after their last turn.
  Aligned<EdgeBlock> edges_;
  std::vector<int> edge_order_;
  Aligned<HingeBlock> hinges_;
  std::vector<int> hinge_order_;
  int search_interval_ = 1;  // Substeps from one search for nearest points to the next.
  int bend_interval_ = 1;    // Substeps from one bending to the next.
  std::vector<ChainRow> chains_;
  std::vector<ActivePlane> planes_;
  Layers layers_;
  AlignedFloats position_, move_;
  std::vector<bool> near_;
  bool moves_air_ = false;
  std::vector<double> holding_forces_;
  std::vector<int> held_edges_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLVER_H_
