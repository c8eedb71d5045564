// The engine plugin "softgym_mj.cloth": elasticity, bending, contact and friction of flexes in one solve.

#ifndef SOFTGYM_MJ_CLOTH_CLOTH_H_
#define SOFTGYM_MJ_CLOTH_CLOTH_H_

namespace softgym_mj::cloth {

void RegisterCloth();

}  // namespace softgym_mj::cloth

#endif  // SOFTGYM_MJ_CLOTH_CLOTH_H_
