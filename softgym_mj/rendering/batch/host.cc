#include "batch/threads.h"
#include "native/export.h"
#include "rendering/batch/draw.h"

// Returns the bytes of memory for images of a scene with (height, width) pixels and samples^2 samples each.
SGM_EXPORT void softgym_mj_pictures_batch_memory(const char* scene, long long height, long long width,
                                                 long long samples, long long* size) {
  using namespace softgym_mj::pictures;
  softgym_mj::Memory memory(nullptr);
  Canvas unused;
  TakeCanvas(*reinterpret_cast<const Scene*>(scene), height, width, samples, &memory, &unused);
  *size = memory.size();
}

// Renders all environments by at most as many threads as slots; `turns`: order of iterations (group.h).
SGM_EXPORT void softgym_mj_pictures_batch_step(const softgym_mj::pictures::Batch* batch, int threads, int turns) {
  softgym_mj::InThreads(static_cast<int>(batch->num_envs), threads, [&](int i, int slot) {
    softgym_mj::Turns() = turns;
    softgym_mj::pictures::DrawEnvironment(*batch, i, slot);
  });
}

// Returns sizes of the structs that layout.py writes.
SGM_EXPORT void softgym_mj_pictures_batch_layout(long long* sizes) {
  using namespace softgym_mj::pictures;
  const size_t found[] = {sizeof(Material), sizeof(Solid),   sizeof(Rigid), sizeof(Light),
                          sizeof(Eye),      sizeof(Texture), sizeof(Scene)};
  for (size_t i = 0; i < sizeof(found) / sizeof(found[0]); ++i) sizes[i] = static_cast<long long>(found[i]);
}
