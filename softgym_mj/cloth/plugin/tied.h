// Vertices that ride on bodies which give way: what flexes and contacts do to them is done to the bodies.

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
  // To be called first in a step of `timestep` and substeps of h [s]. Those whose body gives way ride on it from here
  // on; to the rows they are as heavy as their share of it.
  void Start(Bodies* bodies, double timestep, double h, cloth::Start* start);
  // Begins a substep.
  void Release(const Points& points) const;
  // Once vertices and bodies have moved freely.
  void Move(const Points& points);
  // Passes what a sweep did to the vertices on to the bodies.
  void Pass(const Points& points);
  // Ends a substep, and the bodies have: rows take the vertices for held until the next one.
  void Hold(const Points& points);
  // Ends a step: vertices with slides of their own are where the bodies are in mjData.
  void Finish(const mjModel* m, const mjData* d, Motion* motion) const;

 private:
  struct Rider {
    Tie tie;
    int body;            // In the bodies.
    float inverse_mass;  // [1/kg]
    double acceleration[3];
    double start[3], arm[3];  // From the body's centre, at the start of the step and now [m].
    double own[3], gone[3];   // Way that MuJoCo moves it relative to the body, in a substep and so far [m].
    float place[3];           // Where the body has it [m].
  };

  void Push(const Rider& rider, const double way[3]);
  void Follow(const Points& points);

  double h_ = 0;
  Bodies* bodies_ = nullptr;
  std::vector<Rider> riders_;
};

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_TIED_H_
