#include "reset.h"

#include <cmath>
#include <vector>

#include <mujoco/mjplugin.h>

namespace softgym_mj {
namespace {

thread_local bool restarting = false;

}  // namespace

void Warn(const mjModel* m, mjData* d, int instance, const char* reason, mjtWarning kind) {
  mjWarningStat& warning = d->warning[kind];
  if (!warning.number) {
    const char* name = mj_id2name(m, mjOBJ_PLUGIN, instance);
    mju_warning("%s, instance \"%s\": %s Time = %.4f.", mjp_getPluginAtSlot(m->plugin[instance])->name,
                name ? name : "", reason, d->time);
  }
  warning.lastinfo = instance;
  ++warning.number;
}

bool AreSane(const mjtNum* numbers, int count) {
  bool sane = true;
  for (int i = 0; i < count; ++i) sane &= std::fabs(numbers[i]) <= mjMAXVAL;
  return sane;
}

void Restart(const mjModel* m, mjData* d) {
  if (m->opt.disableflags & mjDSBL_AUTORESET) return;
  std::vector<mjtNum> state(mj_stateSize(m, mjSTATE_INTEGRATION));
  // MuJoCo ends the process if it has no memory for an mjData, so this allocation fails first.
  ::operator delete(::operator new(d->nbuffer + d->narena));
  restarting = true;
  mjData* fresh = mj_makeData(m);
  restarting = false;
  mj_getState(m, fresh, state.data(), mjSTATE_INTEGRATION);
  mj_deleteData(fresh);
  mj_setState(m, d, state.data(), mjSTATE_INTEGRATION);
  mj_forward(m, d);  // Plugins that advance after this one need consistent data.
}

bool IsRestarting() { return restarting; }

}  // namespace softgym_mj
