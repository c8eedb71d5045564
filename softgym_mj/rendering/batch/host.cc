#include "native/export.h"
#include "native/threads.h"
#include "rendering/batch/draw.h"

// Bytes of memory that pictures of a scene need, of (height, width) pixels with samples^2 samples each.
SGM_EXPORT long long softgym_mj_pictures_batch_memory(const char* scene, long long height, long long width,
                                                      long long samples) {
  using namespace softgym_mj::pictures;
  softgym_mj::Memory memory(nullptr);
  Canvas unused;
  TakeCanvas(*reinterpret_cast<const Scene*>(scene), height, width, samples, &memory, &unused);
  return memory.size();
}

// Pictures of all worlds, by as many threads as there are slots; `turns`: see group.h.
SGM_EXPORT void softgym_mj_pictures_batch_step(const softgym_mj::pictures::Batch* batch, int, int turns) {
  const int slots = static_cast<int>(batch->num_slots);
  softgym_mj::InThreads(slots, slots, [&](int slot) {
    softgym_mj::Turns() = turns;
    for (long long i = slot; i < batch->num_worlds; i += batch->num_slots) {
      softgym_mj::pictures::DrawWorld(*batch, i, slot);
    }
  });
}
