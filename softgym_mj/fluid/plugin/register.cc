#include <mujoco/mjplugin.h>

#include "fluid.h"

mjPLUGIN_LIB_INIT(softgym_mj) { softgym_mj::RegisterFluid(); }
