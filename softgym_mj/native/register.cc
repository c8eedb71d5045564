#include <mujoco/mjplugin.h>

#include "cloth_contact.h"
#include "fluid.h"

mjPLUGIN_LIB_INIT(softgym_mj) {
  softgym_mj::RegisterFluid();
  softgym_mj::RegisterClothContact();
}
