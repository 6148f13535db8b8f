// SPDX-License-Identifier: Apache-2.0
// A best-fit allocator in one long range of addresses: it takes the smallest free range that fits
// and merges free neighbours. So the memory of activations can serve gradients of other sizes,
// which size classes could not do.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory_resource>
#include <vector>

namespace tilegrad::nn {

// Not thread-safe. Equal sequences of calls from equal states behave equally: a training step that
// starts in the state of the one before needs no more memory.
class AddressArena {
 public:
  AddressArena() = default;
  ~AddressArena();
  AddressArena(const AddressArena&) = delete;
  AddressArena& operator=(const AddressArena&) = delete;

  static std::size_t Rounded(std::size_t bytes);  // what Allocate really takes
  // Uninitialised, aligned to kAlignment. Throws std::bad_alloc where the system has no memory, as
  // operator new does, and is as before then.
  std::byte* Allocate(std::size_t bytes);
  void Free(std::byte* data, std::size_t bytes);  // of Allocate(bytes)
  void Trim();                                    // returns free memory to the system

  std::size_t held() const { return held_; }        // memory that is or ever was in use
  std::size_t growths() const { return growths_; }  // how often held() had to grow

 private:
  using FreeRanges = std::pmr::map<std::byte*, std::size_t>;
  struct Region {
    std::byte* begin;
    std::size_t reserved, used, usable;  // addresses; given out once; with memory behind them
  };
  FreeRanges::iterator BestFit(std::size_t size);
  std::byte* Grow(std::size_t size);
  void AddRegion(std::size_t bytes);

  std::pmr::unsynchronized_pool_resource nodes_;  // of the map: no allocation in the steady state
  FreeRanges free_{&nodes_};
  std::vector<Region> regions_;  // the last one grows
  std::size_t held_ = 0, growths_ = 0;
};

}  // namespace tilegrad::nn
