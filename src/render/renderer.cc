// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/default_floats.h"
#include "base/error.h"
#include "render/engine.h"

namespace tilegrad {

// State that a failed call may have left inconsistent.
template <class T>
struct RendererScratch {
  using EngineOf = std::conditional_t<std::is_same_v<T, float>, Engine, ReferenceRenderer>;

  explicit RendererScratch(const Workers& workers) : engine(workers) {}

  EngineOf engine;
  GradientTargets<T> targets;
};

inline namespace v0 {

template <class T>
struct FrameT<T>::Impl {
  // The lists of a scene, kept for Backward.
  struct Lists {
    std::vector<TextureT<T>> textures;
    std::vector<SurfaceT<T>> surfaces;
    std::vector<LightT<T>> lights;
  };

  void Keep(std::span<const SceneT<T>> from) {
    if (lists.size() < from.size()) lists.resize(from.size());
    scenes.assign(from.begin(), from.end());
    for (std::size_t n = 0; n < from.size(); ++n) {
      const auto keep = [](auto& list, auto& view) {
        list.assign(view.begin(), view.end());
        view = list;
      };
      keep(lists[n].textures, scenes[n].textures);
      keep(lists[n].surfaces, scenes[n].surfaces);
      keep(lists[n].lights, scenes[n].lights);
    }
  }

  std::vector<SceneT<T>> scenes;  // views of the caller's arrays and of `lists`
  std::vector<Lists> lists;
  RenderOptions options;
  FrameImagesT<T> images;
};

template <class T>
struct RendererT<T>::Impl {
  explicit Impl(int threads) : own_workers(threads), workers(&*own_workers) {}
  explicit Impl(const Workers& shared) : workers(&shared) {}

  Status Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                const Outputs& outputs, typename FrameT<T>::Impl* frame) {
    frame->options = options;
    frame->Keep(scenes);
    return scratch->engine.Render(frame->scenes, frame->options, outputs, &frame->images);
  }
  Status Backward(const typename FrameT<T>::Impl& frame, const FrameGradientsT<T>& d_frame,
                  std::span<const SceneGradientsT<T>> d_scenes, GradientMode mode) {
    auto& [engine, targets] = *scratch;
    const bool add = mode == GradientMode::kAdd;
    TILEGRAD_TRY(targets.Begin(frame.scenes, d_scenes));
    if (add) targets.Save();
    Status status = Guarded([&] {
      return engine.Backward(frame.scenes, frame.options, frame.images, d_frame, &targets);
    });
    if (status.ok()) status = targets.Join(add);
    if (!status.ok() && add) targets.Restore();
    return status;
  }

  std::optional<Workers> own_workers;
  const Workers* workers;
  std::optional<RendererScratch<T>> scratch;  // from Start on
};

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
  constexpr int kMostThreads = 1024;
  if (impl_ == nullptr) {
    if (options_.threads < 0 || options_.threads > kMostThreads) {
      return InvalidArgument("threads is {}, must be in 0..{}", options_.threads, kMostThreads);
    }
    impl_ = std::make_unique<Impl>(options_.threads);
  }
  if (!impl_->scratch) impl_->scratch.emplace(*impl_->workers);
  return {};
}

template <class T>
Status RendererT<T>::Render(std::span<const SceneT<T>> scenes, const RenderOptions& options,
                            const Outputs& outputs, FrameT<T>* frame) {
  if (frame == nullptr) return Guarded([] { return InvalidArgument("frame is null"); });
  frame->images_ = {};
  const DefaultFloats floats;
  Status status = Guarded([&]() -> Status {
    TILEGRAD_TRY(Start());
    if (frame->impl_ == nullptr) frame->impl_ = std::make_unique<typename FrameT<T>::Impl>();
    return impl_->Render(scenes, options, outputs, frame->impl_.get());
  });
  if (status.ok()) {
    frame->images_ = ImagesOf(frame->impl_->images);
  } else {
    DropAfter(status);
  }
  return status;
}

template <class T>
Status RendererT<T>::Backward(const FrameT<T>& frame, const FrameGradientsT<T>& d_frame,
                              std::span<const SceneGradientsT<T>> d_scenes, GradientMode mode) {
  const DefaultFloats floats;
  Status status = Guarded([&]() -> Status {
    if (frame.images_.width == 0) {
      return InvalidArgument("the frame holds nothing: Render into it first");
    }
    TILEGRAD_TRY(Start());
    return impl_->Backward(*frame.impl_, d_frame, d_scenes, mode);
  });
  DropAfter(status);
  return status;
}

// An exception may have left scratch memory inconsistent.
template <class T>
void RendererT<T>::DropAfter(const Status& status) {
  const StatusCode code = status.code();
  const bool thrown = code == StatusCode::kResourceExhausted || code == StatusCode::kInternal;
  if (thrown && impl_ != nullptr) impl_->scratch.reset();
}

struct RendererAccess {
  template <class T>
  static RendererT<T> On(const Workers& workers) {
    RendererT<T> renderer;
    renderer.impl_ = std::make_unique<typename RendererT<T>::Impl>(workers);
    return renderer;
  }
  static PlanReport Explain(const Renderer& renderer) {
    const bool ran = renderer.impl_ != nullptr && renderer.impl_->scratch;
    return ran ? renderer.impl_->scratch->engine.Explain() : PlanReport();
  }
};

template class FrameT<float>;
template class FrameT<double>;
template class RendererT<float>;
template class RendererT<double>;

}  // namespace v0

template <class T>
RendererT<T> RendererOn(const Workers& workers) {
  return RendererAccess::On<T>(workers);
}
template RendererT<float> RendererOn(const Workers&);
template RendererT<double> RendererOn(const Workers&);

PlanReport Explain(const Renderer& renderer) { return RendererAccess::Explain(renderer); }

}  // namespace tilegrad
