// Vectors that reuse memory. A small cluster needs hundreds of short ones: to allocate them took an eighth of its time.
#pragma once
#include <cstddef>
#include <vector>

constexpr std::size_t BLOCK_UNIT = 16;  // bytes; sizes of blocks are in this unit
void* take_block(std::size_t units);
void keep_block(void* block, std::size_t units);  // for the next take_block() of this thread

template <class T>
struct KeepBlocks {
  using value_type = T;
  KeepBlocks() = default;
  template <class U>
  KeepBlocks(const KeepBlocks<U>&) {}
  T* allocate(std::size_t count) { return static_cast<T*>(take_block(units(count))); }
  void deallocate(T* first, std::size_t count) { keep_block(first, units(count)); }
  bool operator==(const KeepBlocks&) const { return true; }
  bool operator!=(const KeepBlocks&) const { return false; }

 private:
  static_assert(alignof(T) <= BLOCK_UNIT);
  static std::size_t units(std::size_t count) { return (count * sizeof(T) + BLOCK_UNIT - 1) / BLOCK_UNIT; }
};

template <class T>
using List = std::vector<T, KeepBlocks<T>>;
