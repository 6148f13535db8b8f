// SPDX-License-Identifier: Apache-2.0
#include "train/render_op.h"

#include <memory>

#include "base/error.h"
#include "render/renderer_ref.h"

namespace tilegrad::train {
namespace {

// One rendering of a batch and what its way back needs. Lives in the tape's closure.
template <class T>
class BatchRender {
 public:
  BatchRender(Renderer& renderer, RenderJob job, nn::Tensor positions, nn::Tensor colors)
      : renderer_(renderer),
        job_(std::move(job)),
        positions_(std::move(positions)),
        colors_(std::move(colors)) {
    const auto size = static_cast<std::size_t>(positions_.shape()[1] * 3);
    for (std::size_t n = 0; n < job_.cameras.size(); ++n) {
      const std::size_t mesh = n / static_cast<std::size_t>(job_.views);
      scenes_.push_back({.positions = Positions().subspan(mesh * size, size),
                         .faces = job_.faces,
                         .attributes = Colors().subspan(mesh * size, size),
                         .channels = 3,
                         .camera = CameraCast<T>(job_.cameras[n])});
    }
  }

  Status Forward();
  Status Backward(const FrameGradientsT<T>& d_frame, std::span<SceneGradientsT<T>> d_scenes);
  // Gradients of the views of one mesh are summed in view order.
  Status Gradients(std::span<const nn::Tensor> d_outputs, nn::Tensor& d_positions,
                   nn::Tensor& d_colors);

  const FrameT<T>& frame() const { return frame_; }

 private:
  std::span<const T> Positions() const { return std::as_const(positions_).template span<T>(); }
  std::span<const T> Colors() const { return std::as_const(colors_).template span<T>(); }

  Renderer& renderer_;
  RenderJob job_;
  nn::Tensor positions_, colors_;
  std::vector<SceneViewT<T>> scenes_;
  FrameT<T> frame_;
};

template <>
Status BatchRender<float>::Forward() {
  return renderer_.Render(scenes_, job_.options, RenderRequest{}, &frame_);
}

template <>
Status BatchRender<float>::Backward(const FrameGradients& d_frame,
                                    std::span<SceneGradients> d_scenes) {
  return renderer_.Backward(scenes_, job_.options, frame_, d_frame, d_scenes);
}

// The reference renders one scene at a time; its frames are laid side by side.
template <>
Status BatchRender<double>::Forward() {
  for (const auto& scene : scenes_) {
    FrameT<double> one;
    RenderRef(scene, job_.options, RenderRequest{}, &one);
    frame_.face_ids.insert(frame_.face_ids.end(), one.face_ids.begin(), one.face_ids.end());
    frame_.attributes.insert(frame_.attributes.end(), one.attributes.begin(), one.attributes.end());
    frame_.alpha.insert(frame_.alpha.end(), one.alpha.begin(), one.alpha.end());
  }
  return {};
}

template <>
Status BatchRender<double>::Backward(const FrameGradientsT<double>& d_frame,
                                     std::span<SceneGradientsT<double>> d_scenes) {
  const std::size_t plane =
      static_cast<std::size_t>(job_.options.width) * static_cast<std::size_t>(job_.options.height);
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    FrameGradientsT<double> one;
    if (!d_frame.attributes.empty())
      one.attributes = d_frame.attributes.subspan(3 * n * plane, 3 * plane);
    if (!d_frame.alpha.empty()) one.alpha = d_frame.alpha.subspan(n * plane, plane);
    const std::span<const std::int32_t> ids(frame_.face_ids.data() + n * plane, plane);
    RenderRefBackward(scenes_[n], job_.options, ids, one, {0, job_.options.height}, &d_scenes[n]);
  }
  return {};
}

template <class T>
void AddViews(const std::vector<AlignedVector<T>>& per_scene, int views, std::span<T> out) {
  const std::size_t size = per_scene[0].size();
  for (std::size_t n = 0; n < per_scene.size(); ++n) {
    T* to = &out[n / static_cast<std::size_t>(views) * size];
    const bool first = n % static_cast<std::size_t>(views) == 0;
    for (std::size_t i = 0; i < size; ++i) to[i] = (first ? T(0) : to[i]) + per_scene[n][i];
  }
}

template <class T>
Status BatchRender<T>::Gradients(std::span<const nn::Tensor> d_outputs, nn::Tensor& d_positions,
                                 nn::Tensor& d_colors) {
  const auto size = static_cast<std::size_t>(positions_.shape()[1] * 3);
  std::vector<AlignedVector<T>> positions(scenes_.size(), AlignedVector<T>(size)),
      colors = positions;
  std::vector<SceneGradientsT<T>> d_scenes(scenes_.size());
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    d_scenes[n].positions = positions[n];
    d_scenes[n].attributes = colors[n];
  }
  FrameGradientsT<T> d_frame;
  if (!d_outputs[0].empty()) d_frame.attributes = d_outputs[0].template span<T>();
  if (!d_outputs[1].empty()) d_frame.alpha = d_outputs[1].template span<T>();
  TILEGRAD_TRY(Backward(d_frame, d_scenes));
  AddViews(positions, job_.views, d_positions.template span<T>());
  AddViews(colors, job_.views, d_colors.template span<T>());
  return {};
}

template <class T>
RenderedImages Render(Renderer& renderer, const nn::Var& positions, const nn::Var& colors,
                      RenderJob job) {
  nn::Context& context = positions.context();
  const auto images = static_cast<std::int64_t>(job.cameras.size());
  const std::int64_t height = job.options.height, width = job.options.width;
  auto batch =
      std::make_shared<BatchRender<T>>(renderer, std::move(job), positions.value(), colors.value());
  if (Status status = batch->Forward(); !status.ok()) {
    const nn::Var failed = nn::Fail(positions, std::move(status));
    return {failed, failed};
  }
  auto backward = [batch, &context,
                   shape = positions.shape()](std::span<const nn::Tensor> d_outputs) {
    std::vector<nn::Tensor> d_inputs = {context.Empty(shape, nn::kDTypeOf<T>),
                                        context.Empty(shape, nn::kDTypeOf<T>)};
    if (Status status = batch->Gradients(d_outputs, d_inputs[0], d_inputs[1]); !status.ok())
      context.Fail(std::move(status));
    return d_inputs;
  };
  const FrameT<T>& frame = batch->frame();
  const std::vector<nn::Var> out = nn::External(
      context,
      {.name = "render",
       .inputs = {positions, colors},
       .outputs = {context.From({images, 3, height, width}, std::span<const T>(frame.attributes)),
                   context.From({images, height, width}, std::span<const T>(frame.alpha))},
       .backward = std::move(backward)});
  return {out[0], out[1]};
}

}  // namespace

RenderedImages RenderMeshes(Renderer& renderer, const nn::Var& positions, const nn::Var& colors,
                            RenderJob job) {
  if (!positions.valid() || !colors.valid()) return {positions, colors};
  return nn::WithFloatType(positions.dtype(), [&]<class T>(T) {
    return Render<T>(renderer, positions, colors, std::move(job));
  });
}

}  // namespace tilegrad::train
