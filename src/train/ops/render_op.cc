// SPDX-License-Identifier: Apache-2.0
#include "train/ops/render_op.h"

#include <memory>

#include "base/error.h"
#include "render/pipeline/pipeline_ref.h"

namespace tilegrad::train {
namespace {

PipelineFrame& FrameOf(MeshRenderer& renderer, float) { return renderer.frame; }
PipelineFrameT<double>& FrameOf(MeshRenderer& renderer, double) { return renderer.frame64; }

// One rendering of a batch and what its way back needs. Lives in the tape's closure.
template <class T>
class BatchRender {
 public:
  BatchRender(MeshRenderer& renderer, RenderJob job, nn::Tensor positions, nn::Tensor colors)
      : renderer_(renderer),
        job_(std::move(job)),
        positions_(std::move(positions)),
        colors_(std::move(colors)),
        frame_(FrameOf(renderer, T{})) {
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
  Status Backward(const PipelineCotangentsT<T>& d_frame, std::span<PipelineGradientsT<T>> d_scenes);
  Status Gradients(nn::Context& context, std::span<const nn::Tensor> d_outputs,
                   std::span<nn::Tensor> d_inputs);

  const PipelineFrameT<T>& frame() const { return frame_; }

 private:
  std::span<const T> Positions() const { return std::as_const(positions_).template span<T>(); }
  std::span<const T> Colors() const { return std::as_const(colors_).template span<T>(); }

  MeshRenderer& renderer_;
  RenderJob job_;
  nn::Tensor positions_, colors_;
  std::vector<PipelineSceneT<T>> scenes_;
  PipelineFrameT<T>& frame_;
};

template <>
Status BatchRender<float>::Forward() {
  return renderer_.renderer.Render(scenes_, job_.options, Outputs{}, &frame_);
}

template <>
Status BatchRender<float>::Backward(const PipelineCotangents& d_frame,
                                    std::span<PipelineGradients> d_scenes) {
  return renderer_.renderer.Backward(scenes_, job_.options, frame_, d_frame, d_scenes);
}

// The reference renders one scene at a time; its frames are laid side by side.
template <>
Status BatchRender<double>::Forward() {
  frame_ = {};
  for (const auto& scene : scenes_) {
    PipelineFrameT<double> one;
    RenderRef(scene, job_.options, Outputs{}, &one);
    frame_.face_ids.insert(frame_.face_ids.end(), one.face_ids.begin(), one.face_ids.end());
    frame_.attributes.insert(frame_.attributes.end(), one.attributes.begin(), one.attributes.end());
    frame_.alpha.insert(frame_.alpha.end(), one.alpha.begin(), one.alpha.end());
  }
  return {};
}

template <>
Status BatchRender<double>::Backward(const PipelineCotangentsT<double>& d_frame,
                                     std::span<PipelineGradientsT<double>> d_scenes) {
  const std::size_t plane =
      static_cast<std::size_t>(job_.options.width) * static_cast<std::size_t>(job_.options.height);
  for (std::size_t n = 0; n < scenes_.size(); ++n) {
    PipelineCotangentsT<double> one;
    if (!d_frame.attributes.empty())
      one.attributes = d_frame.attributes.subspan(3 * n * plane, 3 * plane);
    if (!d_frame.alpha.empty()) one.alpha = d_frame.alpha.subspan(n * plane, plane);
    const std::span<const std::int32_t> ids(frame_.face_ids.data() + n * plane, plane);
    RenderRefBackward(scenes_[n], job_.options, ids, one, {0, job_.options.height}, &d_scenes[n]);
  }
  return {};
}

// [meshes * views][size] to [meshes][size]: the views of one mesh are summed in view order.
template <class T>
void AddViews(std::span<const T> per_scene, std::size_t views, std::size_t size, std::span<T> out) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    const T* from = &per_scene[i / size * views * size + i % size];
    T sum = 0;
    for (std::size_t v = 0; v < views; ++v) sum += from[v * size];
    out[i] = sum;
  }
}

template <class T>
Status BatchRender<T>::Gradients(nn::Context& context, std::span<const nn::Tensor> d_outputs,
                                 std::span<nn::Tensor> d_inputs) {
  const nn::Shape all = {static_cast<std::int64_t>(scenes_.size()), positions_.shape()[1], 3};
  nn::Tensor positions = context.Empty(all, nn::kDTypeOf<T>),
             colors = context.Empty(all, nn::kDTypeOf<T>);
  const auto size = static_cast<std::size_t>(positions_.shape()[1] * 3);
  std::vector<PipelineGradientsT<T>> d_scenes(scenes_.size());
  for (std::size_t n = 0; n < d_scenes.size(); ++n) {
    d_scenes[n].positions = positions.span<T>().subspan(n * size, size);
    d_scenes[n].attributes = colors.span<T>().subspan(n * size, size);
  }
  PipelineCotangentsT<T> d_frame;
  if (!d_outputs[0].empty()) d_frame.attributes = d_outputs[0].template span<T>();
  if (!d_outputs[1].empty()) d_frame.alpha = d_outputs[1].template span<T>();
  TILEGRAD_TRY(Backward(d_frame, d_scenes));
  const auto views = static_cast<std::size_t>(job_.views);
  AddViews<T>(positions.span<T>(), views, size, d_inputs[0].span<T>());
  AddViews<T>(colors.span<T>(), views, size, d_inputs[1].span<T>());
  return {};
}

template <class T>
RenderedImages Render(MeshRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
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
    if (Status status = batch->Gradients(context, d_outputs, d_inputs); !status.ok())
      context.Fail(std::move(status));
    return d_inputs;
  };
  const PipelineFrameT<T>& frame = batch->frame();
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

RenderedImages RenderMeshes(MeshRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                            RenderJob job) {
  if (!positions.valid() || !colors.valid()) return {positions, colors};
  return nn::WithFloatType(positions.dtype(), [&]<class T>(T) {
    return Render<T>(renderer, positions, colors, std::move(job));
  });
}

}  // namespace tilegrad::train
