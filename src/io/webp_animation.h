// SPDX-License-Identifier: Apache-2.0
// Looping animations that every browser shows: WebP, by libwebp.
#pragma once

#include <span>

#include "base/file.h"
#include "base/progress.h"
#include "scene/image.h"

namespace tilegrad::io {

struct AnimationOptions {
  int frame_ms = 83;  // duration of each frame, 1 to 65535; 83: twelve per second
  int quality = 75;   // of the lossy coder, 0 to 100
  Watch watch = {};   // called at each frame
};

// 1 to 16384 frames of one size, 3 or 4 channels, straight alpha, at most 16383 pixels a side (the
// format's limit). The same frames give the same bytes. Equal consecutive frames may be merged.
// InvalidArgument names the frame or value out of range.
Result<Bytes> EncodeWebpAnimation(std::span<const ImageU8> frames,
                                  const AnimationOptions& options = {});
// Atomic.
Status SaveWebpAnimation(const Path& path, std::span<const ImageU8> frames,
                         const AnimationOptions& options = {});

}  // namespace tilegrad::io
