// The engine plugin "softgym_mj.cloth_contact": contact of cloth and cords with themselves and each other.

#ifndef SOFTGYM_MJ_FLUID_CLOTH_CONTACT_H_
#define SOFTGYM_MJ_FLUID_CLOTH_CONTACT_H_

namespace softgym_mj {

void RegisterClothContact();

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_FLUID_CLOTH_CONTACT_H_
