// Batch of environments with water and its steps on a CPU.

#ifndef SOFTGYM_MJ_FLUID_BATCH_HOST_H_
#define SOFTGYM_MJ_FLUID_BATCH_HOST_H_

namespace softgym_mj::fluid {

// Arrays of all environments; each row has room for the largest model.
struct Batch {
  long long num_envs, most_particles, most_walls, most_bodies, kept_size, num_slots, memory_size;
  const char* const* models;  // (num_envs,) Models; environments with null are not stepped.
  char* kept;                 // (num_envs, kept_size) Unused.
  char* memory;               // (num_slots, memory_size) Scratch memory.
  double *known, *positions, *velocities, *walls;
  const double* poses;
  int* begun;        // Number of environments begun on a GPU.
  const int* order;  // (num_envs,) Their order.
  long long* cost;   // (num_envs,) GPU cycles of the last step.
  int* flags;        // (num_envs,) Bits of `Flag`, which accumulate.
  double *forces, *pending;
  const double* mobility;
  long long most_pushed;  // Room for walls in `forces` and `pending`.
};

// Steps environment `i` in a slot; `turns`: order of iterations (group.h).
void StepOnePortable(const Batch& batch, int i, int slot, int turns);
#ifdef SOFTGYM_MJ_X86
void StepOneAvx2(const Batch& batch, int i, int slot, int turns);
#endif

}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_HOST_H_
