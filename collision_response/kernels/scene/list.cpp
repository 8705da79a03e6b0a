// The memory that vectors reuse.
#include "list.hpp"

#include <array>
#include <new>

namespace {

class KeptBlocks;
// An access to a variable of this model takes one instruction, not a call.
__attribute__((tls_model("initial-exec"))) thread_local KeptBlocks* kept = nullptr;

// The blocks that a thread no longer uses, by their size in units.
class KeptBlocks {
 public:
  KeptBlocks() { kept = this; }
  ~KeptBlocks() {
    kept = nullptr;
    for (std::size_t units = 0; units < first_of.size(); ++units)
      while (void* const block = take(units)) ::operator delete(block);
  }

  // Take a block of a size, or nullptr if there is none.
  void* take(std::size_t units) {
    if (units >= first_of.size() || !first_of[units]) return nullptr;
    Block* const block = first_of[units];
    first_of[units] = block->next;
    --count;
    return block;
  }

  // Keep a block. Whether there is room for it.
  bool keep(void* block, std::size_t units) {
    if (units >= first_of.size() || count == MOST) return false;
    first_of[units] = new (block) Block{first_of[units]};
    ++count;
    return true;
  }

 private:
  struct Block { Block* next; };
  static constexpr int MOST = 4096;  // which are 4 MB if all are large
  std::array<Block*, 64> first_of{};
  int count = 0;
};

}  // namespace

void* take_block(std::size_t units) {
  if (kept)
    if (void* const block = kept->take(units)) return block;
  thread_local const KeptBlocks of_this_thread;
  return ::operator new(BLOCK_UNIT * units);
}

void keep_block(void* block, std::size_t units) {
  if (!kept || !kept->keep(block, units)) ::operator delete(block);
}
