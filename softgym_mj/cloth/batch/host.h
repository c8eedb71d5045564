// Batch of environments and its steps on a CPU.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_HOST_H_
#define SOFTGYM_MJ_CLOTH_BATCH_HOST_H_

namespace softgym_mj::cloth {

constexpr int kQuickBytes = 48;  // Bytes per vertex in fast memory (StepEnvironmentOf).

// Arrays of all environments; each row has room for the largest model.
struct Batch {
  long long num_envs, most_vertices, most_edges, num_grippers, kept_size, num_slots, memory_size;
  const char* const* models;  // (num_envs,) Models; environments with null are not stepped.
  char* kept;                 // (num_envs, kept_size) Initially zero.
  char* memory;               // (num_slots, memory_size) Scratch memory.
  double *valid, *qpos, *qvel, *reference, *after_edge, *holding_force, *after_layers, *gripper_qpos, *gripper_qvel;
  const double *targets, *goals;
  const int* held;
  int* begun;        // Number of environments begun on a GPU.
  const int* order;  // (num_envs,) Their order.
  long long* cost;   // (num_envs,) GPU cycles of the last step.
  int* flags;        // (num_envs,) Bits of `Flag`, which accumulate.
  double* twist;     // From here on last, so that builds without these read the rest.
  const double *poses, *velocities, *accelerations;
  const int* touching;
  double *solid_forces, *sides;
  const double *jacobians, *responses;
  double* solid_impulses;
  long long num_solids, num_faces, num_dofs;
  double* pushes;
  long long num_pushed;
};

// Steps environment `i` in a slot; `turns`: order of iterations (group.h).
void StepOnePortable(const Batch& batch, int i, int slot, int turns);
#ifdef SOFTGYM_MJ_X86
void StepOneAvx2(const Batch& batch, int i, int slot, int turns);
#endif

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_HOST_H_
