// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>

#include "render/renderer_ref.h"
#include "render/validate.h"

namespace tilegrad {

struct Renderer::Impl {
  const Workers& workers;
  explicit Impl(const Workers& w) : workers(w) {}
};

Renderer::Renderer(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

namespace {

template <class Vector>
void CopyImage(const Vector& image, std::size_t n, Vector* batch) {
  std::copy(image.begin(), image.end(),
            batch->begin() + static_cast<std::ptrdiff_t>(n * image.size()));
}

template <class T>
std::span<T> ImageOf(std::span<T> batch, std::size_t n, std::size_t images) {
  const std::size_t size = batch.size() / images;
  return batch.subspan(n * size, size);
}

}  // namespace

Status Renderer::Render(std::span<const SceneView> scenes, const RenderOptions& options,
                        const RenderRequest& request, Frame* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_TRY(ValidateScenes(scenes));
  const int channels = scenes.empty() ? 0 : scenes[0].channels;
  SizeFrame(static_cast<int>(scenes.size()), channels, options, request, frame);
  impl_->workers.For(scenes.size(), [&](std::size_t n, std::size_t) {
    Frame image;
    RenderRef(scenes[n], options, request, &image);
    CopyImage(image.face_ids, n, &frame->face_ids);
    CopyImage(image.attributes, n, &frame->attributes);
    CopyImage(image.alpha, n, &frame->alpha);
    CopyImage(image.depth, n, &frame->depth);
    CopyImage(image.barycentrics, n, &frame->barycentrics);
  });
  return {};
}

Status Renderer::Backward(std::span<const SceneView> scenes, const RenderOptions& options,
                          const Frame& frame, const FrameGradients& d_frame,
                          std::span<SceneGradients> d_scenes) {
  TILEGRAD_TRY(ValidateBackward(scenes, options, frame, d_frame, d_scenes));
  const std::size_t images = scenes.size();
  impl_->workers.For(images, [&](std::size_t n, std::size_t) {
    const FrameGradients d_image{ImageOf(d_frame.attributes, n, images),
                                 ImageOf(d_frame.alpha, n, images)};
    RenderRefBackward<float>(scenes[n], options,
                             ImageOf(std::span<const std::int32_t>(frame.face_ids), n, images),
                             d_image, {0, options.height}, &d_scenes[n]);
  });
  return {};
}

}  // namespace tilegrad
