#ifndef SOFTGYM_MJ_CLOTH_SOLIDS_H_
#define SOFTGYM_MJ_CLOTH_SOLIDS_H_
namespace softgym_mj::cloth {
class Solids {};
}
#endif
