// Export macro of functions that Python calls by name.

#ifndef SOFTGYM_MJ_NATIVE_EXPORT_H_
#define SOFTGYM_MJ_NATIVE_EXPORT_H_

#ifdef _WIN32
#define SGM_EXPORT extern "C" __declspec(dllexport)
#else
#define SGM_EXPORT extern "C" __attribute__((visibility("default")))
#endif

#endif  // SOFTGYM_MJ_NATIVE_EXPORT_H_
