// Step of all flexes: substeps of elasticity, contact and friction in one solver.

#ifndef SOFTGYM_MJ_CLOTH_SOLVER_H_
#define SOFTGYM_MJ_CLOTH_SOLVER_H_

#include <vector>

#include "cloth/plugin/chains.h"
#include "cloth/plugin/driven.h"
#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/layers.h"
#include "cloth/plugin/mesh.h"
#include "cloth/plugin/planes.h"
#include "cloth/plugin/solids.h"
#include "cloth/plugin/springs.h"
#include "cloth/plugin/start.h"
#include "cloth/plugin/state.h"
#include "cloth/plugin/tied.h"
#include "cloth/plugin/twists.h"
#include "native/aligned.h"

namespace softgym_mj::cloth {

struct Settings {
  int substeps = 25;
  int sweeps = 15;                  // Sweeps over contacts near dynamic bodies per substep.
  double contact_stiffness = 2000;  // [N/m] Contact stiffness.
  double contact_damping = 0.01;    // [s] Contact damping as a multiple of the stiffness.
};

class Solver {
 public:
  // Rebuilds the solver after a change of the mesh, the settings or the time step [s].
  void Reset(const Mesh& mesh, const Settings& settings, double timestep);

  // Moves the vertices by a step; `motion` gets their displacements and final velocities. Returns false if contacts
  // were left out because too many features are in one place.
  bool Step(const Mesh& mesh, const Start& start, const std::vector<PlaneContact>& planes, Solids* solids, Tied* tied,
            const Kept& kept, Motion* motion);

  // Ends the twist of a step, once tied vertices have their motion.
  void EndTwist(const Start& start, const Motion& motion) { twists_.End(start, motion); }

  double substep() const { return h_; }
  const ContactRow& contact() const { return contact_; }
  const ContactRow& plane_row() const { return plane_row_; }
  const EdgeRows& edges() const { return edges_; }
  const HingeRows& hinges() const { return hinges_; }
  const ChainRows& chains() const { return chains_; }
  const TwistRows& twists() const { return twists_; }
  const Layers& layers() const { return layers_; }

 private:
  void StartPoints(const Mesh& mesh, const Start& start);
  void FindLayers(const Mesh& mesh, const Start& start, const Solids& solids, const Kept& kept);
  // Whether contacts near bodies are swept more than once.
  bool Repeats(const Solids& solids) const { return solids.TouchesBodies() && settings_.sweeps > 1; }
  void Substep(int substep, Solids* solids, Tied* tied);
  void Finish(const Mesh& mesh, const Start& start, Solids* solids, Motion* motion);
  // Prevents penetration by impact zones and restores the length of affected ropes. Returns the number of changed
  // vertices.
  int Prevent(Motion* motion);
  // Moves the points with a motion of the vertices.
  void Follow(const Motion& motion);

  const ClothKernels* kernels_ = nullptr;
  Settings settings_;
  double timestep_ = 0, h_ = 0;
  ContactRow contact_ = {}, plane_row_ = {};
  Points points_ = {};
  AlignedFloats now_, before_, drift_, bent_drift_, predicted_, moved_, air_;
  AlignedFloats with_layers_;  // `now_` after the layers' last sweep.
  int search_interval_ = 1;    // Substeps from one search for nearest points to the next.
  EdgeRows edges_;
  HingeRows hinges_;
  ChainRows chains_;
  TwistRows twists_;
  Planes planes_;
  Layers layers_;
  Driven driven_;
  ImpactZones impact_zones_;
  std::vector<double> acceleration_;  // Acceleration including drag.
  AlignedFloats position_, move_, end_;
  std::vector<bool> near_;
  bool moves_air_ = false;
  std::vector<double> holding_forces_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_SOLVER_H_
