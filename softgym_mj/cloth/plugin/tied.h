// Vertices tied to dynamic bodies: impulses of flexes and contacts on them act on the bodies.

#ifndef SOFTGYM_MJ_CLOTH_TIED_H_
#define SOFTGYM_MJ_CLOTH_TIED_H_

#include <vector>

#include "cloth/plugin/bodies.h"
#include "cloth/plugin/impact_zones.h"
#include "cloth/plugin/kernels.h"
#include "cloth/plugin/start.h"

namespace softgym_mj::cloth {

class Tied {
 public:
  // Starts a step of `timestep` with substeps of h [s]. Vertices tied to dynamic bodies follow them, and rows see them
  // with their share of the body's mass.
  void Start(Bodies* bodies, double timestep, double h, cloth::Start* start);
  // Begins a substep.
  void Release(const Points& points) const;
  // Moves tied vertices after the free motion of vertices and bodies.
  void Move(const Points& points);
  // Transmits the impulses of a sweep on the vertices to the bodies.
  void Pass(const Points& points);
  // Ends a substep after the bodies: the vertices count as held until the next one.
  void Hold(const Points& points);
  // Ends a step: moves vertices with their own slides to the bodies in mjData.
  void Finish(const mjModel* m, const mjData* d, Motion* motion) const;

 private:
  struct Rider {
    Tie tie;
    int body;            // Index in the bodies.
    float inverse_mass;  // [1/kg]
    double acceleration[3];
    double start[3], arm[3];  // Vector from the body's center, at the start of the step and now [m].
    double own[3], gone[3];   // MuJoCo's motion relative to the body, per substep and so far [m].
    float place[3];           // Displacement with the body [m].
  };

  void Push(const Rider& rider, const double way[3]);
  void Follow(const Points& points);

  double h_ = 0;
  Bodies* bodies_ = nullptr;
  std::vector<Rider> riders_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_TIED_H_
