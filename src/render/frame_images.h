// SPDX-License-Identifier: Apache-2.0
// The arrays behind a Frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/aligned.h"
#include "render/scene_fields.h"
#include "tilegrad/renderer.h"

namespace tilegrad {

// The images of a batch, planar: row 0 on top. Calls of the same size reuse them without
// allocation.
template <class T>
struct FrameImagesT {
  int images = 0, channels = 0, height = 0, width = 0;  // channels: of attributes
  // Of N images; shapes and background as in ImagesT.
  AlignedVector<std::int32_t> face_ids;
  AlignedVector<T> color, alpha, attributes, depth, normals, uv, barycentrics;
  double alpha_error_bound = 0;
  // [N, H W] 1 - alpha to relative precision, where Backward needs it, in the order of
  // raster/soft_mask/soft_mask.h, SoftMaskImages; elsewhere unspecified.
  AlignedVector<T> transmittance;
  // [N,H,W], or empty. In: a pixel shows the nearest face whose 1/depth is less than this
  // (raster/visibility.h: PeelVisibility). Out: 1/depth of that face, 0 if there is none. Only the
  // engine's forward pass supports it.
  AlignedVector<T> peeled;
};
using FrameImages = FrameImagesT<float>;

// Allocates the requested images of the given number of scenes, and no others.
template <class T>
void SizeFrame(std::size_t images, int channels, const RenderOptions& options,
               const Outputs& outputs, FrameImagesT<T>* frame) {
  frame->images = static_cast<int>(images);
  frame->channels = outputs.attributes ? channels : 0;
  frame->height = options.height;
  frame->width = options.width;
  const std::size_t pixels =
      images * static_cast<std::size_t>(options.height) * static_cast<std::size_t>(options.width);
  frame->face_ids.resize(pixels);
  ForEachOutput(
      channels,
      [&](const char*, int planes, bool wanted, AlignedVector<T>& image) {
        image.resize(wanted ? static_cast<std::size_t>(planes) * pixels : 0);
      },
      outputs, *frame);
  frame->alpha_error_bound = 0;
}

// Views of the images.
template <class T>
ImagesT<T> ImagesOf(const FrameImagesT<T>& frame) {
  ImagesT<T> out;
  out.count = frame.images;
  out.height = frame.height;
  out.width = frame.width;
  out.channels = frame.channels;
  out.face_ids = frame.face_ids;
  ForEachOutput(
      frame.channels,
      [](const char*, int, std::span<const T>& view, const AlignedVector<T>& image) {
        view = image;
      },
      out, frame);
  out.alpha_error_bound = frame.alpha_error_bound;
  return out;
}

}  // namespace tilegrad
