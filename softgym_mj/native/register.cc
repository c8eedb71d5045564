#include <mujoco/mjplugin.h>

#include "cloth/plugin/cloth.h"
#include "fluid/plugin/fluid.h"

mjPLUGIN_LIB_INIT(softgym_mj) {
  softgym_mj::RegisterFluid();
  softgym_mj::cloth::RegisterCloth();
}
