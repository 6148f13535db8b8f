// SPDX-License-Identifier: Apache-2.0
#include "train/ops/rival_op.h"

#include <memory>

#include "base/error.h"

namespace tilegrad::train {
namespace {

rivals::RendererT<float>& RendererOf(RivalRenderer& r, float) { return r.renderer; }
rivals::RendererT<double>& RendererOf(RivalRenderer& r, double) { return r.renderer64; }

struct RivalColors {
  const nn::Var& colors;  // invalid: none
  bool faces = false;     // texels of faces, else colours of vertices
};

// One rendering and what its way back needs. Lives in the tape's closure.
template <class T>
struct RivalBatch {
  rivals::RendererT<T>& renderer;
  RivalJob job;
  nn::Tensor positions, colors;  // colors: empty without
  bool textured;                 // they are texels of faces
  std::vector<CameraT<T>> cameras;

  RivalBatch(RivalRenderer& r, RivalJob rival_job, const nn::Var& at, const RivalColors& of)
      : renderer(RendererOf(r, T{})),
        job(std::move(rival_job)),
        positions(at.value()),
        textured(of.faces) {
    if (of.colors.valid()) colors = of.colors.value();
    for (const Camera& camera : job.cameras) cameras.push_back(CameraCast<T>(camera));
  }
  rivals::BatchT<T> View() {
    const std::span<const T> given = colors.empty() ? std::span<T>() : colors.span<T>();
    rivals::BatchT<T> batch{positions.span<T>(),
                            {},
                            job.faces,
                            cameras,
                            static_cast<std::size_t>(positions.shape()[0]),
                            job.size};
    (textured ? batch.textures : batch.colors) = given;
    return batch;
  }
  std::vector<nn::Tensor> Images(nn::Context& context) const {
    const auto n = static_cast<std::int64_t>(cameras.size());
    std::vector<nn::Tensor> out = {context.Empty({n, job.size, job.size}, nn::kDTypeOf<T>)};
    if (!colors.empty()) out.push_back(context.Empty({n, 3, job.size, job.size}, nn::kDTypeOf<T>));
    return out;
  }
  std::vector<nn::Tensor> Gradients(nn::Context& context, std::span<const nn::Tensor> d_outputs);
};

// The numbers of the i-th tensor, if it is there.
template <class T>
std::span<T> SpanOf(std::span<const nn::Tensor> tensors, std::size_t i) {
  if (i >= tensors.size() || tensors[i].empty()) return {};
  nn::Tensor tensor = tensors[i];  // shares its memory
  return tensor.span<T>();
}

template <class T>
std::vector<nn::Tensor> RivalBatch<T>::Gradients(nn::Context& context,
                                                 std::span<const nn::Tensor> d_outputs) {
  std::vector<nn::Tensor> out = {context.Empty(positions.shape(), nn::kDTypeOf<T>)};
  if (!colors.empty()) out.push_back(context.Empty(colors.shape(), nn::kDTypeOf<T>));
  rivals::GradientsT<T> to{SpanOf<T>(out, 0), {}};
  (textured ? to.textures : to.colors) = SpanOf<T>(out, 1);
  Status done = renderer.Backward(View(), job.options,
                                  {SpanOf<T>(d_outputs, 0), SpanOf<T>(d_outputs, 1)}, to);
  if (!done.ok()) context.Fail(std::move(done));
  return out;
}

template <class T>
RenderedImages Render(RivalRenderer& renderer, const nn::Var& positions, const RivalColors& colors,
                      RivalJob job) {
  nn::Context& context = positions.context();
  auto batch = std::make_shared<RivalBatch<T>>(renderer, std::move(job), positions, colors);
  const std::vector<nn::Tensor> images = batch->Images(context);
  Status status = batch->renderer.Render(batch->View(), batch->job.options,
                                         {SpanOf<T>(images, 0), SpanOf<T>(images, 1)});
  if (!status.ok()) {
    const nn::Var failed = nn::Fail(positions, std::move(status));
    return {failed, failed};
  }
  std::vector<nn::Var> inputs = {positions};
  if (colors.colors.valid()) inputs.push_back(colors.colors);
  const std::vector<nn::Var> out =
      nn::External(context, {.name = "render_rival",
                             .inputs = inputs,
                             .outputs = images,
                             .backward = [batch, &context](std::span<const nn::Tensor> d_outputs) {
                               return batch->Gradients(context, d_outputs);
                             }});
  return {out.size() > 1 ? out[1] : nn::Var(), out[0]};
}

RenderedImages RenderChecked(RivalRenderer& renderer, const nn::Var& positions,
                             const RivalColors& colors, RivalJob job) {
  if (!positions.valid()) return {positions, positions};
  const nn::Shape& shape = positions.shape();
  if (shape.rank() != 3 || shape[2] != 3 || job.size < 1) {
    const nn::Var failed = nn::Fail(
        positions, InvalidArgument("positions have the shape {} for images of {} pixels a side, "
                                   "expected [meshes, vertices, 3]",
                                   shape.ToString(), job.size));
    return {failed, failed};
  }
  return nn::WithFloatType(positions.dtype(), [&]<class T>(T) {
    return Render<T>(renderer, positions, colors, std::move(job));
  });
}

}  // namespace

RenderedImages RenderRival(RivalRenderer& renderer, const nn::Var& positions, const nn::Var& colors,
                           RivalJob job) {
  return RenderChecked(renderer, positions, {colors}, std::move(job));
}

RenderedImages RenderTextured(RivalRenderer& renderer, const nn::Var& positions,
                              const nn::Var& textures, RivalJob job) {
  if (!textures.valid()) return {textures, textures};
  return RenderChecked(renderer, positions, {textures, true}, std::move(job));
}

}  // namespace tilegrad::train
