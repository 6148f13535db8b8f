// SPDX-License-Identifier: Apache-2.0
#include "scene/shrink_image.h"

#include <algorithm>
#include <array>
#include <vector>

namespace tilegrad {
namespace {

// The first of the pixels behind each of `to` ones along an axis of `from`; last, `from`.
std::vector<int> Blocks(int from, int to) {
  std::vector<int> first;
  for (int i = 0; i <= to; ++i)
    first.push_back(static_cast<int>(static_cast<std::int64_t>(i) * from / to));
  return first;
}

// Of the rows from `top` up to `bottom`, column by column: [width][channels].
void AddRows(const ImageU8& image, int top, int bottom, std::vector<std::uint32_t>* sums) {
  std::fill(sums->begin(), sums->end(), 0);
  for (int v = top; v < bottom; ++v) {
    const std::uint8_t* const row = image.at(0, v);
    for (std::size_t i = 0; i < sums->size(); ++i) (*sums)[i] += row[i];
  }
}

// A row of means, each of the columns from one of `columns` up to the next, whose sums are of
// `height` rows. The quotient's whole part by a product: half a step beyond the quotient, no whole
// number is within reach of double's error.
template <std::size_t channels>
void MeansOfColumns(const std::vector<std::uint32_t>& sums, int height,
                    const std::vector<int>& columns, std::uint8_t* to) {
  const std::uint32_t* at = sums.data();
  for (std::size_t x = 0; x + 1 < columns.size(); ++x) {
    const int width = columns[x + 1] - columns[x];
    const std::int64_t count = static_cast<std::int64_t>(height) * width;
    std::array<std::int64_t, channels> sum;
    sum.fill(count / 2);
    for (int u = 0; u < width; ++u, at += channels) {
      for (std::size_t c = 0; c < channels; ++c) sum[c] += at[c];
    }
    const double inverse = 1 / static_cast<double>(count);
    for (std::size_t c = 0; c < channels; ++c)
      *to++ = static_cast<std::uint8_t>((static_cast<double>(sum[c]) + 0.5) * inverse);
  }
}
constexpr std::array kMeansByChannels = {MeansOfColumns<1>, MeansOfColumns<2>, MeansOfColumns<3>,
                                         MeansOfColumns<4>};

}  // namespace

ImageU8 ShrunkImage(const ImageU8& image, int side) {
  const int longest = std::max(image.width, image.height);
  if (longest <= side) return image;
  const auto shorter = [&](int n) {
    return std::max(1, static_cast<int>(static_cast<std::int64_t>(n) * side / longest));
  };
  ImageU8 out(shorter(image.width), shorter(image.height), image.channels);
  const std::vector<int> rows = Blocks(image.height, out.height),
                         columns = Blocks(image.width, out.width);
  std::vector<std::uint32_t> sums(static_cast<std::size_t>(image.width * image.channels));
  const auto means = kMeansByChannels[static_cast<std::size_t>(image.channels - 1)];
  for (std::size_t y = 0; y + 1 < rows.size(); ++y) {
    AddRows(image, rows[y], rows[y + 1], &sums);
    means(sums, rows[y + 1] - rows[y], columns, out.at(0, static_cast<int>(y)));
  }
  return out;
}

}  // namespace tilegrad
