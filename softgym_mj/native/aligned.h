// Arrays aligned to 32 bytes, for vectors of eight floats.

#ifndef SOFTGYM_MJ_NATIVE_ALIGNED_H_
#define SOFTGYM_MJ_NATIVE_ALIGNED_H_

#include <cstddef>
#include <new>
#include <vector>

namespace softgym_mj {

template <class T>
struct AlignedAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{32};

  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, kAlignment); }
  bool operator==(const AlignedAllocator&) const { return true; }
  bool operator!=(const AlignedAllocator&) const { return false; }
};

template <class T>
using Aligned = std::vector<T, AlignedAllocator<T>>;
using AlignedFloats = Aligned<float>;

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_ALIGNED_H_
