// Arrays in one block of memory.

#ifndef SOFTGYM_MJ_BATCH_MEMORY_H_
#define SOFTGYM_MJ_BATCH_MEMORY_H_

namespace softgym_mj {

// Allocates arrays in a block of memory; without a block it only counts the size they need.
class Memory {
 public:
  explicit Memory(char* start) : start_(start) {}
  template <class T>
  void Take(T** p, long long count) {
    constexpr long long kAlign = 32;
    size_ = (size_ + kAlign - 1) / kAlign * kAlign;
    *p = start_ ? reinterpret_cast<T*>(start_ + size_) : nullptr;
    size_ += count * static_cast<long long>(sizeof(T));
  }
  long long size() const { return (size_ + 31) / 32 * 32; }

 private:
  char* start_;
  long long size_ = 0;
};

}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_MEMORY_H_
