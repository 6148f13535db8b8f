// SPDX-License-Identifier: Apache-2.0
#include "train/ops/rival_op.h"

#include <memory>

#include "base/error.h"

namespace tilegrad::train {
namespace {

rivals::RendererT<float>& RendererOf(RivalRenderer& r, float) { return r.renderer; }
rivals::RendererT<double>& RendererOf(RivalRenderer& r, double) { return r.renderer64; }

// One rendering and what its way back needs. Lives in the tape's closure.
template <class T>
struct RivalBatch {
  rivals::RendererT<T>& renderer;
  RivalJob job;
  nn::Tensor positions;
  std::vector<CameraT<T>> cameras;

  RivalBatch(RivalRenderer& r, RivalJob rival_job, nn::Tensor at)
      : renderer(RendererOf(r, T{})), job(std::move(rival_job)), positions(std::move(at)) {
    for (const Camera& camera : job.cameras) cameras.push_back(CameraCast<T>(camera));
  }
  rivals::BatchT<T> View() {
    return {positions.span<T>(), job.faces, cameras, static_cast<std::size_t>(positions.shape()[0]),
            job.size};
  }
};

template <class T>
nn::Var Render(RivalRenderer& renderer, const nn::Var& positions, RivalJob job) {
  nn::Context& context = positions.context();
  auto batch = std::make_shared<RivalBatch<T>>(renderer, std::move(job), positions.value());
  nn::Tensor alpha = context.Empty(
      {static_cast<std::int64_t>(batch->cameras.size()), batch->job.size, batch->job.size},
      nn::kDTypeOf<T>);
  Status status = batch->renderer.Render(batch->View(), batch->job.options, alpha.span<T>());
  if (!status.ok()) return nn::Fail(positions, std::move(status));
  auto backward = [batch, &context](std::span<const nn::Tensor> d_outputs) {
    if (d_outputs[0].empty()) return std::vector<nn::Tensor>(1);
    nn::Tensor d_positions = context.Empty(batch->positions.shape(), nn::kDTypeOf<T>);
    nn::Tensor d_alpha = d_outputs[0];
    Status done = batch->renderer.Backward(batch->View(), batch->job.options, d_alpha.span<T>(),
                                           d_positions.span<T>());
    if (!done.ok()) context.Fail(std::move(done));
    return std::vector<nn::Tensor>{d_positions};
  };
  return nn::External(context, {.name = "render_rival",
                                .inputs = {positions},
                                .outputs = {alpha},
                                .backward = std::move(backward)})[0];
}

}  // namespace

nn::Var RenderRival(RivalRenderer& renderer, const nn::Var& positions, RivalJob job) {
  if (!positions.valid()) return positions;
  const nn::Shape& shape = positions.shape();
  if (shape.rank() != 3 || shape[2] != 3 || job.size < 1) {
    return nn::Fail(positions, InvalidArgument("positions have the shape {} for images of {} "
                                               "pixels a side, expected [meshes, vertices, 3]",
                                               shape.ToString(), job.size));
  }
  return nn::WithFloatType(positions.dtype(), [&]<class T>(T) {
    return Render<T>(renderer, positions, std::move(job));
  });
}

}  // namespace tilegrad::train
