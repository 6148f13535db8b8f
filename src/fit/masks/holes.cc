// SPDX-License-Identifier: Apache-2.0
#include "fit/masks/holes.h"

#include <algorithm>
#include <utility>

namespace tilegrad::train {
namespace {

constexpr int kRim = 2;                // pixels between a hole's core and the mask
constexpr std::size_t kLeastCore = 8;  // pixels; the mean colour of fewer is mostly noise
constexpr float kInside = 0.5f;

// Calls use(q) for the pixels at most `reach` columns and rows from p.
template <class Use>
void ForSquare(ImageSize size, std::size_t p, int reach, Use use) {
  const int x = static_cast<int>(p) % size.width, y = static_cast<int>(p) / size.width;
  for (int v = std::max(0, y - reach); v <= std::min(size.height - 1, y + reach); ++v) {
    for (int u = std::max(0, x - reach); u <= std::min(size.width - 1, x + reach); ++u)
      use(static_cast<std::size_t>(v * size.width + u));
  }
}

bool IsAtBorder(ImageSize size, std::size_t p) {
  const int x = static_cast<int>(p) % size.width, y = static_cast<int>(p) / size.width;
  return x == 0 || y == 0 || x == size.width - 1 || y == size.height - 1;
}

// Clears and returns the connected component (8 neighbours) of `set` [H,W] that holds p.
std::vector<std::size_t> TakeComponent(ImageSize size, std::size_t p,
                                       std::vector<std::uint8_t>* set) {
  std::vector<std::size_t> component = {p};
  (*set)[p] = 0;
  for (std::size_t i = 0; i < component.size(); ++i) {
    ForSquare(size, component[i], 1, [&](std::size_t q) {
      if ((*set)[q] == 0) return;
      (*set)[q] = 0;
      component.push_back(q);
    });
  }
  return component;
}

Hole HoleAround(std::vector<std::size_t> core, std::span<const float> inside, ImageSize size) {
  std::vector<float> mask(inside.size());
  for (const std::size_t p : core) mask[p] = 1;
  const std::vector<std::uint8_t> near = Dilated(mask, size, kRim);
  Hole out{std::move(core), {}};
  for (std::size_t p = 0; p < near.size(); ++p) {
    if (near[p] != 0 && inside[p] < kInside) out.pixels.push_back(p);
  }
  return out;
}

}  // namespace

std::vector<std::uint8_t> Dilated(std::span<const float> mask, ImageSize size, int reach) {
  std::vector<std::uint8_t> out(mask.size());
  for (std::size_t p = 0; p < mask.size(); ++p) {
    if (mask[p] >= kInside) ForSquare(size, p, reach, [&](std::size_t q) { out[q] = 1; });
  }
  return out;
}

std::vector<Hole> HolesOf(std::span<const float> inside, ImageSize size) {
  std::vector<std::uint8_t> outside = Dilated(inside, size, kRim);
  for (std::uint8_t& pixel : outside) pixel = pixel == 0 ? 1 : 0;
  for (std::size_t p = 0; p < outside.size(); ++p) {
    if (outside[p] != 0 && IsAtBorder(size, p)) TakeComponent(size, p, &outside);
  }
  std::vector<Hole> out;
  for (std::size_t p = 0; p < outside.size(); ++p) {
    if (outside[p] == 0) continue;
    std::vector<std::size_t> core = TakeComponent(size, p, &outside);
    if (core.size() >= kLeastCore) out.push_back(HoleAround(std::move(core), inside, size));
  }
  return out;
}

}  // namespace tilegrad::train
