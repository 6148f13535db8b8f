// SPDX-License-Identifier: Apache-2.0
#include "train/ops/render_op.h"

#include <memory>

#include "base/error.h"

namespace tilegrad::train {
namespace {

Renderer& RendererOf(MeshRenderer& mesh, float) { return mesh.renderer; }
RendererT<double>& RendererOf(MeshRenderer& mesh, double) { return mesh.renderer64; }
Frame& FrameOf(MeshRenderer& mesh, float) { return mesh.frame; }
FrameT<double>& FrameOf(MeshRenderer& mesh, double) { return mesh.frame64; }

// One rendering of a batch and what its way back needs. Lives in the tape's closure.
template <class T>
class BatchRender {
 public:
  BatchRender(MeshRenderer& renderer, RenderJob job, nn::Tensor positions, nn::Tensor colors)
      : renderer_(RendererOf(renderer, T{})),
        frame_(FrameOf(renderer, T{})),
        job_(std::move(job)),
        positions_(std::move(positions)),
        colors_(std::move(colors)) {}

  Status Forward() {
    const std::span<const T> positions = std::as_const(positions_).template span<T>(),
                             colors = std::as_const(colors_).template span<T>();
    std::vector<SceneT<T>> scenes(job_.cameras.size());
    for (std::size_t n = 0; n < scenes.size(); ++n) {
      scenes[n].positions = OfMesh(positions, n), scenes[n].faces = job_.faces;
      scenes[n].colors = {OfMesh(colors, n), Rate::kVertex};
      scenes[n].camera = CameraCast<T>(job_.cameras[n]);
    }
    return renderer_.Render(scenes, job_.options, {.attributes = false}, &frame_);
  }

  // Views of one mesh are given the same arrays, which get their sum in view order.
  Status Gradients(std::span<const nn::Tensor> d_outputs, std::span<nn::Tensor> d_inputs) {
    std::vector<SceneGradientsT<T>> d_scenes(job_.cameras.size());
    for (std::size_t n = 0; n < d_scenes.size(); ++n) {
      d_scenes[n].positions = OfMesh(d_inputs[0].span<T>(), n);
      d_scenes[n].colors = OfMesh(d_inputs[1].span<T>(), n);
    }
    FrameGradientsT<T> d_frame;
    if (!d_outputs[0].empty()) d_frame.color = d_outputs[0].template span<T>();
    if (!d_outputs[1].empty()) d_frame.alpha = d_outputs[1].template span<T>();
    return renderer_.Backward(frame_, d_frame, d_scenes);
  }

  const ImagesT<T>& images() const { return frame_.images(); }

 private:
  template <class U>
  std::span<U> OfMesh(std::span<U> all, std::size_t image) const {
    const auto size = static_cast<std::size_t>(positions_.shape()[1] * 3);
    return all.subspan(image / static_cast<std::size_t>(job_.views) * size, size);
  }

  RendererT<T>& renderer_;
  FrameT<T>& frame_;
  RenderJob job_;
  nn::Tensor positions_, colors_;
};

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
    if (Status status = batch->Gradients(d_outputs, d_inputs); !status.ok())
      context.Fail(std::move(status));
    return d_inputs;
  };
  const ImagesT<T>& drawn = batch->images();
  const std::vector<nn::Var> out =
      nn::External(context, {.name = "render",
                             .inputs = {positions, colors},
                             .outputs = {context.From({images, 3, height, width}, drawn.color),
                                         context.From({images, height, width}, drawn.alpha)},
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
