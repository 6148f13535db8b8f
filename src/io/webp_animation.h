// SPDX-License-Identifier: Apache-2.0
// Animations that every browser shows, again and again: WebP, by libwebp.
#pragma once

#include <span>

#include "base/file.h"
#include "base/progress.h"
#include "scene/image.h"

namespace tilegrad::io {

struct AnimationOptions {
  int frame_ms = 83;  // how long each frame stands, 1 to 65535; 83: twelve a second
  int quality = 75;   // of the lossy coder, 0 to 100
  Watch watch = {};   // asked at each frame
};

// 1 to 16384 frames of one size, 3 or 4 channels, straight alpha, at most 16383 pixels a side (the
// format's limit). The same frames give the same bytes. Frames that are equal to the one before may
// be joined with it. InvalidArgument names the frame or the number that is not possible.
Result<Bytes> EncodeWebpAnimation(std::span<const ImageU8> frames,
                                  const AnimationOptions& options = {});
// Whole or not at all.
Status SaveWebpAnimation(const Path& path, std::span<const ImageU8> frames,
                         const AnimationOptions& options = {});

}  // namespace tilegrad::io
