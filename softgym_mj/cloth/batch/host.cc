#include "cloth/batch/host.h"

#include "batch/threads.h"
#include "cloth/batch/environment.h"
#include "native/export.h"
#include "native/instructions.h"

namespace softgym_mj::cloth {
namespace {

auto ChooseStepOne() {
#ifdef SOFTGYM_MJ_X86
  return UseAvx2() ? StepOneAvx2 : StepOnePortable;
#else
  return StepOnePortable;
#endif
}

}  // namespace
}  // namespace softgym_mj::cloth

// Returns bytes kept by an environment of a model, and bytes of scratch memory of a slot.
SGM_EXPORT void softgym_mj_cloth_batch_memory(const char* model, long long* sizes) {
  using namespace softgym_mj::cloth;
  const auto& description = *reinterpret_cast<const Model*>(model);
  softgym_mj::Memory kept(nullptr), memory(nullptr);
  Environment unused;
  TakeKept(description, &kept, &unused);
  TakeMemory(description, &memory, &unused);
  sizes[0] = kept.size(), sizes[1] = memory.size();
}

// Returns the numbers of vertices, edges, grippers, solids and entry faces of a model.
SGM_EXPORT void softgym_mj_cloth_batch_counts(const char* bytes, int* counts) {
  const auto& model = *reinterpret_cast<const softgym_mj::cloth::Model*>(bytes);
  counts[0] = model.vertices, counts[1] = model.edges, counts[2] = model.grippers;
  counts[3] = model.solids;
  counts[4] = model.solids > 0 ? softgym_mj::cloth::kNumSides : 0;
}

// Steps all environments by at most as many threads as slots; `turns`: order of iterations (group.h).
SGM_EXPORT void softgym_mj_cloth_batch_step(const softgym_mj::cloth::Batch* batch, int threads, int turns) {
  using namespace softgym_mj::cloth;
  const auto step = ChooseStepOne();
  softgym_mj::InThreads(batch->num_envs, threads, [&](int i, int slot) { step(*batch, i, slot, turns); });
}
