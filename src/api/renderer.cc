// SPDX-License-Identifier: Apache-2.0
#include "tilegrad/renderer.h"

#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "api/convert.h"
#include "api/gradient_arrays.h"
#include "api/guarded.h"
#include "api/prior_values.h"
#include "api/reference_renderer.h"
#include "api/validate.h"
#include "base/error.h"
#include "base/parallel.h"
#include "render/renderer.h"

namespace tilegrad::v0 {

template <class T>
struct FrameT<T>::Impl {
  std::vector<SceneRecords<T>> records;
  std::vector<engine::ShadedSceneT<T>> scenes;  // look at the caller's arrays and at `records`
  engine::RenderOptions options;
  engine::ShadedFrameT<T> frame;
};

template <class T>
struct RendererT<T>::Impl {
  using Engine =
      std::conditional_t<std::is_same_v<T, float>, engine::ShadedRenderer, ReferenceRenderer>;

  explicit Impl(int threads) : workers(threads), renderer(workers) {}

  Status Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                const Outputs& outputs, typename FrameT<T>::Impl* frame);
  Status Backward(const typename FrameT<T>::Impl& frame, const FrameGradientsT<T>& d_frame,
                  std::span<const SceneGradientsT<T>> d_scenes, GradientMode mode);

  Workers workers;
  Engine renderer;
  std::vector<GradientRecords<T>> gradient_records;
  std::vector<engine::ShadedGradientsT<T>> gradients;
  GradientArrays<T> gradient_arrays;
  PriorValues<T> prior;
};

template <class T>
Status RendererT<T>::Impl::Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                                  const Outputs& outputs, typename FrameT<T>::Impl* frame) {
  TILEGRAD_TRY(ValidateEnumerations(options));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    Status status = ValidateEnumerations(scenes[n]);
    if (status.ok()) status = ValidateLights(scenes[n]);
    if (!status.ok()) return status.Within(fmt::format("scene {}", n));
  }
  frame->options = ToEngine(options);
  if (frame->records.size() < scenes.size()) frame->records.resize(scenes.size());
  frame->scenes.clear();
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    frame->scenes.push_back(ToEngine(scenes[n], &frame->records[n]));
  }
  return renderer.Render(frame->scenes, frame->options, ToEngine(outputs), &frame->frame);
}

template <class T>
Status RendererT<T>::Impl::Backward(const typename FrameT<T>::Impl& frame,
                                    const FrameGradientsT<T>& d_frame,
                                    std::span<const SceneGradientsT<T>> d_scenes,
                                    GradientMode mode) {
  TILEGRAD_TRY(gradient_arrays.Check(frame.scenes, d_scenes));
  const bool add = mode == GradientMode::kAdd;
  if (gradient_records.size() < d_scenes.size()) gradient_records.resize(d_scenes.size());
  gradients.clear();
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    gradients.push_back(ToEngine(d_scenes[n], &gradient_records[n]));
  }
  if (add) prior.Save(d_scenes);
  const Status status =
      renderer.Backward(frame.scenes, frame.options, frame.frame, ToEngine(d_frame), gradients);
  if (!status.ok()) {
    if (add) prior.Restore();
    return status;
  }
  if (add && !prior.Add()) return InvalidArgument("a sum of gradients overflows");
  for (std::size_t n = 0; n < d_scenes.size() && !add; ++n) ClearRecords(d_scenes[n]);
  for (std::size_t n = 0; n < d_scenes.size(); ++n) AddRecords(gradients[n], d_scenes[n]);
  return {};
}

template <class T>
FrameT<T>::FrameT() noexcept = default;
template <class T>
FrameT<T>::~FrameT() = default;
template <class T>
FrameT<T>::FrameT(FrameT&& other) noexcept
    : impl_(std::move(other.impl_)), images_(std::exchange(other.images_, {})) {}
template <class T>
FrameT<T>& FrameT<T>::operator=(FrameT&& other) noexcept {
  impl_ = std::move(other.impl_);
  images_ = std::exchange(other.images_, {});
  return *this;
}

template <class T>
RendererT<T>::RendererT(const RendererOptions& options) noexcept : options_(options) {}
template <class T>
RendererT<T>::~RendererT() = default;
template <class T>
RendererT<T>::RendererT(RendererT&&) noexcept = default;
template <class T>
RendererT<T>& RendererT<T>::operator=(RendererT&&) noexcept = default;

template <class T>
Status RendererT<T>::Start() {
  if (impl_ != nullptr) return {};
  constexpr int kMostThreads = 1024;
  if (options_.threads < 0 || options_.threads > kMostThreads) {
    return InvalidArgument("options.threads is {}, must be in 0..{}", options_.threads,
                           kMostThreads);
  }
  impl_ = std::make_unique<Impl>(options_.threads);
  return {};
}

template <class T>
Status RendererT<T>::Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                            const Outputs& outputs, FrameT<T>* frame) {
  if (frame == nullptr) return Guarded([] { return InvalidArgument("frame is null"); });
  frame->images_ = {};
  const Status status = Guarded([&] {
    TILEGRAD_TRY(Start());
    if (frame->impl_ == nullptr) frame->impl_ = std::make_unique<typename FrameT<T>::Impl>();
    return impl_->Render(scenes, options, outputs, frame->impl_.get());
  });
  if (status.ok()) {
    frame->images_ = ImagesOf(frame->impl_->frame);
  } else {
    DropAfter(status);
  }
  return status;
}

template <class T>
Status RendererT<T>::Backward(const FrameT<T>& frame, const FrameGradientsT<T>& d_frame,
                              std::span<const SceneGradientsT<T>> d_scenes, GradientMode mode) {
  const Status status = Guarded([&]() -> Status {
    if (frame.images_.width == 0) {
      return InvalidArgument("the frame holds nothing: Render into it first");
    }
    TILEGRAD_TRY(Start());
    return impl_->Backward(*frame.impl_, d_frame, d_scenes, mode);
  });
  DropAfter(status);
  return status;
}

// An exception may have left scratch memory between two states.
template <class T>
void RendererT<T>::DropAfter(const Status& status) {
  const StatusCode code = status.code();
  if (code == StatusCode::kResourceExhausted || code == StatusCode::kInternal) impl_.reset();
}

template class FrameT<float>;
template class FrameT<double>;
template class RendererT<float>;
template class RendererT<double>;

}  // namespace tilegrad::v0
