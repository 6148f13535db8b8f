// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/sample_images.h"

#include <algorithm>

#include "nn/nn.h"
#include "train/ops/render_op.h"

namespace tilegrad::train {
namespace {

constexpr int kZoom = 2, kGap = 2;
constexpr float kBackground = 0.88f;  // light grey

// Draws a planar RGB image over black with its alpha at cell (column, row) of the sheet.
struct Sheet {
  ImageU8 image;
  int size;

  void Draw(int column, int row, const float* rgb, const float* alpha) {
    const int plane = size * size, x0 = column * (size * kZoom + kGap),
              y0 = row * (size * kZoom + kGap);
    for (int y = 0; y < size * kZoom; ++y) {
      for (int x = 0; x < size * kZoom; ++x) {
        const int p = y / kZoom * size + x / kZoom;
        for (int c = 0; c < 3; ++c) {
          const float value = rgb[c * plane + p] + kBackground * (1 - alpha[p]);
          image.at(x0 + x, y0 + y)[c] =
              static_cast<std::uint8_t>(255 * std::clamp(value, 0.0f, 1.0f) + 0.5f);
        }
      }
    }
  }
};

}  // namespace

Result<ImageU8> SampleSheet(nn::Context& context, TrainStep& step, const ImageStore& store,
                            std::span<const Sample> samples, std::int64_t at_step) {
  const nn::NoGrad off(context);
  const BatchTensors batch = GatherBatch(context, store, {samples.begin(), samples.end()});
  const PredictedMeshes meshes =
      step.network().Forward(nn::Constant(context, batch.input), nn::Mode::kEval);
  const int views = static_cast<int>(samples[0].views.size());
  const RenderedImages images =
      RenderMeshes(step.renderer(), meshes.positions, meshes.colors,
                   {step.faces(), batch.cameras, views, step.OptionsAt(at_step)});
  TILEGRAD_TRY(context.TakeStatus());
  const int columns = 2 * views, rows = static_cast<int>(samples.size()),
            cell = store.size * kZoom + kGap;
  Sheet sheet{ImageU8(columns * cell - kGap, rows * cell - kGap, 3, 255), store.size};
  const std::size_t plane =
      static_cast<std::size_t>(store.size) * static_cast<std::size_t>(store.size);
  // Soft alpha is a signal for training; people see what is covered.
  std::vector<float> covered(images.alpha.value().elements());
  std::transform(images.alpha.value().data<float>(),
                 images.alpha.value().data<float>() + covered.size(), covered.begin(),
                 [](float alpha) { return alpha == 1 ? 1.0f : 0.0f; });
  for (int row = 0; row < rows; ++row) {
    for (int v = 0; v < views; ++v) {
      const std::size_t n = static_cast<std::size_t>(row * views + v);
      const float* truth = batch.truth_colors.data<float>() + 3 * plane * n;
      const float* predicted = images.colors.value().data<float>() + 3 * plane * n;
      sheet.Draw(2 * v, row, truth, batch.truth_alpha.data<float>() + plane * n);
      sheet.Draw(2 * v + 1, row, predicted, covered.data() + plane * n);
    }
  }
  return sheet.image;
}

}  // namespace tilegrad::train
