// Step of one environment of a `Batch`, by a CPU thread or a block of a GPU.

#ifndef SOFTGYM_MJ_CLOTH_BATCH_ONE_H_
#define SOFTGYM_MJ_CLOTH_BATCH_ONE_H_

#include "cloth/batch/host.h"
#include "cloth/batch/step.h"

namespace softgym_mj::cloth {
namespace {

// Steps environment `i`. `quick`: fast memory of `size` bytes, or null.
inline void StepEnvironmentOf(const Batch& batch, int i, int slot, float* quick = nullptr, int size = 0) {
  if (!batch.models[i]) return;
  SGM_SHARED Environment w;
  Once([&] {
    w.model = reinterpret_cast<const Model*>(batch.models[i]);
    const long long vertices = batch.most_vertices * i, grippers = batch.num_grippers * i;
    w.targets = batch.targets + 3 * grippers;
    w.goals = batch.goals + 3 * grippers;
    w.held = batch.held + grippers;
    w.valid = batch.valid + i;
    w.qpos = batch.qpos + 3 * vertices;
    w.qvel = batch.qvel + 3 * vertices;
    w.reference = batch.reference + 3 * vertices;
    w.after_edge = batch.after_edge + batch.most_edges * i;
    w.holding_force = batch.holding_force + vertices;
    w.after_layers = batch.after_layers + 4 * kKeptPairs * vertices;
    w.gripper_qpos = batch.gripper_qpos + 3 * grippers;
    w.gripper_qvel = batch.gripper_qvel + 3 * grippers;
    w.twist = batch.twist + i;
    const long long solids = batch.num_solids * i;
    w.poses = batch.poses + 7 * solids;
    w.velocities = batch.velocities + 6 * solids;
    w.accelerations = batch.accelerations + 6 * solids;
    w.touching = batch.touching + solids;
    w.solid_forces = batch.solid_forces + 6 * solids;
    w.dofs = static_cast<int>(w.model->solids > 0 ? batch.num_dofs : 0);
    w.jacobians = batch.jacobians + 6 * w.dofs * solids;
    w.responses = batch.responses + 6 * w.dofs * solids;
    w.solid_impulses = batch.solid_impulses + 12 * solids;
    w.pushed = static_cast<int>(batch.num_pushed);
    w.pushes = w.pushed > 0 ? batch.pushes + w.pushed * solids : nullptr;
    w.sides = batch.sides + batch.num_faces * i;
    Memory kept(batch.kept + batch.kept_size * i), memory(batch.memory + batch.memory_size * slot);
    TakeKept(*w.model, &kept, &w);
    TakeMemory(*w.model, &memory, &w);
    const int of_points = 4 * w.model->padded;
    if (size >= kQuickBytes * w.model->padded) {
      w.points.now = quick, w.points.before = quick + of_points, w.points.predicted = quick + 2 * of_points;
    }
  });
  StepEnvironment(w);
  Once([&] { batch.flags[i] |= w.step->flags; });
}

}  // namespace
}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_BATCH_ONE_H_
