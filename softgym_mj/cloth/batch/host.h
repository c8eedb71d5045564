// Environments of a batch, and steps of them on a processor.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_HOST_H_
#define SOFTGYM_MJ_CLOTH_BATCH_HOST_H_

namespace softgym_mj::cloth {

constexpr int kQuickBytes = 48;  // Of each vertex, of what is read and written most: see StepEnvironmentOf.

// Arrays of all environments, with room in each row for the largest model. See Environment.
struct Batch {
  long long num_envs, most_vertices, most_edges, num_grippers, kept_size, num_slots, memory_size;
  const char* const* models;  // (num_envs,) a Model each, or null: of an environment that stands still.
  char* kept;                 // (num_envs, kept_size) zeros at first.
  char* memory;               // (num_slots, memory_size) of whoever makes a step.
  double *valid, *qpos, *qvel, *reference, *after_edge, *holding_force, *after_layers, *gripper_qpos, *gripper_qvel;
  const double *targets, *goals;
  const int* held;
  int* begun;        // How many have been begun on a GPU,
  const int* order;  // (num_envs,) in which order,
  long long* cost;   // and what each took there, in cycles.
  int* flags;        // (num_envs,) what went wrong: bits of `Flag`, added to what is there.
};

// A step of environment `i` in a slot; `turns`: see group.h.
void StepOnePortable(const Batch& batch, int i, int slot, int turns);
#ifdef SOFTGYM_MJ_X86
void StepOneAvx2(const Batch& batch, int i, int slot, int turns);
#endif

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_HOST_H_
