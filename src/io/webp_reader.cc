// SPDX-License-Identifier: Apache-2.0
#include "io/webp_reader.h"

#include <webp/decode.h>

#include <string_view>

#include "base/error.h"
#include "base/read_budget.h"
#include "io/image_check.h"

namespace tilegrad::io {

bool IsWebp(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.size() >= 12 && text.starts_with("RIFF") && text.substr(8, 4) == "WEBP";
}

Result<ImageU8> DecodeWebp(std::span<const std::uint8_t> bytes, const std::string& name) {
  const auto broken = [&] { return DataLoss("{}: a truncated or corrupt WebP image", name); };
  WebPBitstreamFeatures header;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &header) != VP8_STATUS_OK) return broken();
  if (header.has_animation != 0)
    return DataLoss("{}: an animated WebP; save one of its frames", name);
  TILEGRAD_TRY(CheckImageSize(header.width, header.height, name));
  const int channels = header.has_alpha != 0 ? 4 : 3;
  const auto size = static_cast<std::size_t>(header.width) *
                    static_cast<std::size_t>(header.height) * static_cast<std::size_t>(channels);
  TILEGRAD_TRY(ReadBudget::Take(size, name));
  ImageU8 image(header.width, header.height, channels);
  const auto decode = channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (decode(bytes.data(), bytes.size(), image.pixels.data(), size, header.width * channels) ==
      nullptr) {
    return broken();
  }
  return image;
}

}  // namespace tilegrad::io
