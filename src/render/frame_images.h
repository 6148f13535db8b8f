// SPDX-License-Identifier: Apache-2.0
// The arrays behind a Frame.
#pragma once

#include "base/aligned.h"
#include "render/pipeline/records.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

// 0 at background pixels. `attributes` [N,C,H,W] and `channels` are the user's.
template <class T>
struct FrameImagesT : PipelineFrameT<T> {
  AlignedVector<T> color;    // [N,3,H,W]
  AlignedVector<T> normals;  // [N,3,H,W]
  AlignedVector<T> uv;       // [N,2,H,W]
};
using FrameImages = FrameImagesT<float>;

// Views of them.
template <class T>
ImagesT<T> ImagesOf(const FrameImagesT<T>& frame) {
  ImagesT<T> out;
  out.count = frame.images;
  out.height = frame.height;
  out.width = frame.width;
  out.channels = frame.channels;
  out.face_ids = frame.face_ids;
  out.color = frame.color;
  out.alpha = frame.alpha;
  out.attributes = frame.attributes;
  out.depth = frame.depth;
  out.normals = frame.normals;
  out.uv = frame.uv;
  out.barycentrics = frame.barycentrics;
  out.alpha_error_bound = frame.alpha_error_bound;
  return out;
}

}  // namespace tilegrad
