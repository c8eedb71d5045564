#include "cloth/batch/one.h"

namespace softgym_mj::cloth {

void StepOnePortable(const Batch& batch, int i, int turns) {
  Turns() = turns;
  StepWorldOf(batch, i);
}

}  // namespace softgym_mj::cloth
