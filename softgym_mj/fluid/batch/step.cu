// A step of the water of all worlds of a batch on a GPU: a block for each.

#include "fluid/batch/one.h"

extern "C" __global__ void StepWater(const softgym_mj::fluid::Batch batch) {
  if (blockIdx.x < batch.num_worlds) softgym_mj::fluid::StepWorldOf(batch, blockIdx.x);
}
