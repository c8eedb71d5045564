// A step of all worlds of a batch on a GPU: a block for each.

#include "cloth/batch/one.h"

extern "C" __global__ void StepWorlds(const softgym_mj::cloth::Batch batch) {
  if (blockIdx.x < batch.num_worlds) softgym_mj::cloth::StepWorldOf(batch, blockIdx.x);
}
