// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/holes.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace tilegrad::train {
namespace {

constexpr int kRim = 2;                // pixels between a hole's core and the mask
constexpr std::size_t kLeastCore = 8;  // pixels: fewer say little
constexpr float kCovered = 0.5f;

// Bytes [H,W] that are 0 or 1.
class Plane {
 public:
  explicit Plane(ImageSize size)
      : wide_(size.width),
        high_(size.height),
        set_(static_cast<std::size_t>(wide_) * static_cast<std::size_t>(high_)) {}

  std::size_t size() const { return set_.size(); }
  std::uint8_t& operator[](std::size_t p) { return set_[p]; }

  template <class Use>
  void ForSquare(std::size_t p, int reach, Use use) const {
    const int x = static_cast<int>(p) % wide_, y = static_cast<int>(p) / wide_;
    for (int v = std::max(0, y - reach); v <= std::min(high_ - 1, y + reach); ++v) {
      for (int u = std::max(0, x - reach); u <= std::min(wide_ - 1, x + reach); ++u)
        use(static_cast<std::size_t>(v * wide_ + u));
    }
  }

  bool IsAtBorder(std::size_t p) const {
    const int x = static_cast<int>(p) % wide_, y = static_cast<int>(p) / wide_;
    return x == 0 || y == 0 || x == wide_ - 1 || y == high_ - 1;
  }

  // Takes away and returns the pixels from which steps to set neighbours lead to `p`.
  std::vector<std::size_t> TakeRegion(std::size_t p) {
    std::vector<std::size_t> region = {p};
    set_[p] = 0;
    for (std::size_t i = 0; i < region.size(); ++i) {
      ForSquare(region[i], 1, [&](std::size_t q) {
        if (set_[q] == 0) return;
        set_[q] = 0;
        region.push_back(q);
      });
    }
    return region;
  }

 private:
  int wide_, high_;
  std::vector<std::uint8_t> set_;
};

// What is farther than the rim from all that is inside.
Plane FarOutside(std::span<const float> inside, ImageSize size) {
  Plane out(size);
  for (std::size_t p = 0; p < out.size(); ++p) out[p] = 1;
  for (std::size_t p = 0; p < out.size(); ++p) {
    if (inside[p] >= kCovered) out.ForSquare(p, kRim, [&](std::size_t q) { out[q] = 0; });
  }
  return out;
}

// The core and what is outside within the rim of it.
Hole HoleAround(std::vector<std::size_t> core, std::span<const float> inside, ImageSize size) {
  Plane taken(size);
  Hole out{std::move(core), {}};
  for (const std::size_t p : out.core) {
    taken.ForSquare(p, kRim, [&](std::size_t q) {
      if (taken[q] != 0 || inside[q] >= kCovered) return;
      taken[q] = 1;
      out.pixels.push_back(q);
    });
  }
  return out;
}

}  // namespace

std::vector<Hole> HolesOf(std::span<const float> inside, ImageSize size) {
  Plane outside = FarOutside(inside, size);
  for (std::size_t p = 0; p < outside.size(); ++p) {
    if (outside[p] != 0 && outside.IsAtBorder(p)) outside.TakeRegion(p);
  }
  std::vector<Hole> out;
  for (std::size_t p = 0; p < outside.size(); ++p) {
    if (outside[p] == 0) continue;
    std::vector<std::size_t> core = outside.TakeRegion(p);
    if (core.size() >= kLeastCore) out.push_back(HoleAround(std::move(core), inside, size));
  }
  return out;
}

}  // namespace tilegrad::train
