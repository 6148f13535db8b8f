// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"
#include "base/scalar.h"
#include "compat/nvdiffrast/texture.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

// Geometry of halving: steps of 2, or 1 along a side of one texel.
struct Halving {
  std::size_t fine_row, fine_rows, coarse_row;  // numbers of a row; rows of a texture
  std::size_t step_x, step_y, channels;
  std::size_t below;  // from a fine number to that of the second row; 0 if there is none

  Halving(const MipSize& fine, std::size_t c)
      : fine_row(static_cast<std::size_t>(fine.width) * c),
        fine_rows(static_cast<std::size_t>(fine.height)),
        step_x(fine.width > 1 ? 2 : 1),
        step_y(fine.height > 1 ? 2 : 1),
        channels(c),
        below((step_y - 1) * fine_row) {
    coarse_row = fine_row / step_x;
  }
  // Calls visit(coarse number, fine number, its neighbour to the right) for the numbers that belong
  // together of one row of the coarse level, counted over all textures, and the first of the fine
  // rows that it is made of. Both fine numbers are the same where there is no neighbour.
  template <class Visit>
  void ForRow(std::size_t row, const Visit& visit) const {
    switch (channels) {  // a constant makes the loop unroll
      case 1:
        return ForRowOf<1>(row, visit);
      case 3:
        return ForRowOf<3>(row, visit);
      case 4:
        return ForRowOf<4>(row, visit);
      default:
        return ForRowOf<0>(row, visit);
    }
  }

 private:
  template <std::size_t kChannels, class Visit>
  void ForRowOf(std::size_t row, const Visit& visit) const {
    const std::size_t n = kChannels > 0 ? kChannels : channels, rows = fine_rows / step_y;
    std::size_t from = (row / rows * fine_rows + row % rows * step_y) * fine_row;
    const std::size_t beside = (step_x - 1) * n, end = (row + 1) * coarse_row;
    for (std::size_t to = row * coarse_row; to < end; from += beside) {
      for (std::size_t c = 0; c < n; ++c, ++to, ++from) visit(to, from, from + beside);
    }
  }
};

constexpr std::size_t kRowGrain = 16;

}  // namespace

Result<std::vector<MipSize>> MipSizes(const MipSize& base, int most) {
  std::vector<MipSize> sizes = {base};
  while (static_cast<int>(sizes.size()) != most + 1) {
    const auto [height, width] = sizes.back();
    if (height == 1 && width == 1) break;
    if ((height > 1 && height % 2 != 0) || (width > 1 && width % 2 != 0)) {
      return InvalidArgument(
          "a texture of {} x {} texels cannot be halved below {} x {}: make its sides powers of "
          "two, or set max_mip_level to {}",
          base.height, base.width, height, width, sizes.size() - 1);
    }
    sizes.push_back({height > 1 ? height / 2 : 1, width > 1 ? width / 2 : 1});
  }
  return sizes;
}

template <class T>
void HalveTexture(const TextureLevel<T>& fine, std::size_t channels, const Workers& workers,
                  std::span<T> coarse) {
  const Halving halving(fine.size, channels);
  const T share = T(0.5) / static_cast<T>(halving.step_y);
  const T* from = fine.texels.data();
  T* to = coarse.data();
  const std::size_t below = halving.below;
  const auto one_row = [&](std::size_t c, std::size_t a, std::size_t b) {
    to[c] = share * (from[a] + from[b]);
  };
  const auto two_rows = [&](std::size_t c, std::size_t a, std::size_t b) {
    to[c] = share * (from[a] + from[b]) + share * (from[a + below] + from[b + below]);
  };
  workers.ForEach(coarse.size() / halving.coarse_row, kRowGrain, [&](std::size_t row) {
    if (below == 0) {
      halving.ForRow(row, one_row);
    } else {
      halving.ForRow(row, two_rows);
    }
  });
}

template <class T>
void HalveTextureBackward(const TextureLevel<T>& d_coarse, const MipSize& fine,
                          std::size_t channels, const Workers& workers, std::span<T> d_fine) {
  const Halving halving(fine, channels);
  const T share = T(0.5) / static_cast<T>(halving.step_y);
  const T* from = d_coarse.texels.data();
  T* to = d_fine.data();
  const std::size_t below = halving.below;
  const auto pull = [&](std::size_t c, std::size_t a, std::size_t b) {
    const T part = share * from[c];
    to[a] += part;
    to[b] += part;
    if (below == 0) return;
    to[a + below] += part;
    to[b + below] += part;
  };
  workers.ForEach(d_coarse.texels.size() / halving.coarse_row, kRowGrain,
                  [&](std::size_t row) { halving.ForRow(row, pull); });
}

TILEGRAD_INSTANTIATE(HalveTexture);
TILEGRAD_INSTANTIATE(HalveTextureBackward);

}  // namespace tilegrad::compat::nvdiffrast
