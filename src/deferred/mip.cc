// SPDX-License-Identifier: Apache-2.0
#include "deferred/mip.h"

#include "base/error.h"

namespace tilegrad::deferred {
namespace {

// How a level follows from the finer one: ratio 2, or 1 where a side is one texel.
struct Halving {
  std::size_t fine_width, fine_rows, coarse_width, step_x, step_y, channels;

  Halving(const MipSize& fine, std::size_t c)
      : fine_width(static_cast<std::size_t>(fine.width)),
        fine_rows(static_cast<std::size_t>(fine.height)),
        step_x(fine.width > 1 ? 2 : 1),
        step_y(fine.height > 1 ? 2 : 1),
        channels(c) {
    coarse_width = fine_width / step_x;
  }
  std::size_t coarse_rows() const { return fine_rows / step_y; }

  // Calls visit(coarse number, fine number) for the pairs that belong together, of one row of the
  // coarse level; rows are counted over all textures.
  template <class Visit>
  void ForRow(std::size_t row, const Visit& visit) const {
    const std::size_t texture = row / coarse_rows(), y = row % coarse_rows();
    for (std::size_t dy = 0; dy < step_y; ++dy) {
      const std::size_t from = (texture * fine_rows + y * step_y + dy) * fine_width * channels;
      const std::size_t to = row * coarse_width * channels;
      for (std::size_t x = 0; x < coarse_width * step_x; ++x) {
        for (std::size_t c = 0; c < channels; ++c) {
          visit(to + x / step_x * channels + c, from + x * channels + c);
        }
      }
    }
  }
  template <class T>
  T share() const {
    return T(1) / static_cast<T>(step_x * step_y);
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
  const std::size_t row = halving.coarse_width * channels;
  workers.ForRanges(coarse.size() / row, kRowGrain,
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      const T share = halving.share<T>();
                      for (std::size_t i = begin * row; i < end * row; ++i) coarse[i] = T(0);
                      for (std::size_t r = begin; r < end; ++r) {
                        halving.ForRow(r, [&](std::size_t to, std::size_t from) {
                          coarse[to] += share * fine.texels[from];
                        });
                      }
                    });
}

template <class T>
void HalveTextureBackward(const TextureLevel<T>& d_coarse, const MipSize& fine,
                          std::size_t channels, const Workers& workers, std::span<T> d_fine) {
  const Halving halving(fine, channels);
  const std::size_t row = halving.coarse_width * channels;
  workers.ForRanges(d_coarse.texels.size() / row, kRowGrain,
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      const T share = halving.share<T>();
                      for (std::size_t r = begin; r < end; ++r) {
                        halving.ForRow(r, [&](std::size_t from, std::size_t to) {
                          d_fine[to] += share * d_coarse.texels[from];
                        });
                      }
                    });
}

#define TILEGRAD_INSTANTIATE(T)                                                                  \
  template void HalveTexture(const TextureLevel<T>&, std::size_t, const Workers&, std::span<T>); \
  template void HalveTextureBackward(const TextureLevel<T>&, const MipSize&, std::size_t,        \
                                     const Workers&, std::span<T>);
TILEGRAD_INSTANTIATE(float)
TILEGRAD_INSTANTIATE(double)
#undef TILEGRAD_INSTANTIATE

}  // namespace tilegrad::deferred
