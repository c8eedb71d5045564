// Separation of coincident particles, identical to that of `Solver`.

#ifndef SOFTGYM_MJ_FLUID_BATCH_SEPARATE_H_
#define SOFTGYM_MJ_FLUID_BATCH_SEPARATE_H_

#include "fluid/batch/environment.h"
#include "fluid/plugin/motion.h"

namespace softgym_mj::fluid {
namespace {

// Separates coincident particles, as `Solver::Separate`.
inline void Separate(const Environment& w) {
  const Particles& p = w.particles;
  const Step& step = *w.step;
  const auto compare = [&](int i, int j) {
    const auto *a = reinterpret_cast<const unsigned char*>(p.position + 4 * i),
               *b = reinterpret_cast<const unsigned char*>(p.position + 4 * j);
    for (int k = 0; k < 12; ++k) {
      if (a[k] != b[k]) return a[k] < b[k] ? -1 : 1;
    }
    return 0;
  };
  Each(step.nx * step.ny * step.nz, [&](int c) {
    const int first = w.start[c], count = w.start[c + 1] - first;
    int* in_cell = w.spare_order + first;
    for (int k = 0; k < count; ++k) {
      int place = k;
      for (; place > 0; --place) {
        const int order = compare(in_cell[place - 1], first + k);
        if (order < 0 || (order == 0 && in_cell[place - 1] < first + k)) break;
        in_cell[place] = in_cell[place - 1];
      }
      in_cell[place] = first + k;
    }
    for (int k = 1; k < count; ++k) {
      const int i = in_cell[k];
      if (compare(in_cell[k - 1], i) != 0) continue;
      unsigned random = static_cast<unsigned>(w.order[i]);
      for (int axis = 0; axis < 3; ++axis) {
        p.correction[4 * i + axis] += kNudge * w.model->fluid.spacing * NudgeAlong(&random);
      }
    }
  });
}

}  // namespace
}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_SEPARATE_H_
