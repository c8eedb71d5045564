// Water of the environments of a batch, and steps of it on a processor.

#ifndef SOFTGYM_MJ_FLUID_BATCH_HOST_H_
#define SOFTGYM_MJ_FLUID_BATCH_HOST_H_

namespace softgym_mj::fluid {

// Arrays of all environments, with room in each row for the largest model. See Environment.
struct Batch {
  long long num_envs, most_particles, most_walls, most_bodies, kept_size, num_slots, memory_size;
  const char* const* models;  // (num_envs,) a Model each, or null: of an environment that stands still.
  char* kept;                 // (num_envs, kept_size) nothing.
  char* memory;               // (num_slots, memory_size) of whoever makes a step.
  double *known, *positions, *velocities, *walls;
  const double* poses;
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

}  // namespace softgym_mj::fluid

#endif  // SOFTGYM_MJ_FLUID_BATCH_HOST_H_
