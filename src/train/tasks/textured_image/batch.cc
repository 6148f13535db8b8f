// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/batch.h"

#include <algorithm>

#include "base/error.h"

namespace tilegrad::train {
namespace {

template <class T>
void Copy(std::span<const float> from, T* to) {
  std::transform(from.begin(), from.end(), to, [](float x) { return static_cast<T>(x); });
}

// View `m` of the batch, [4][size][size], to where it is seen.
template <class T>
void Place(std::span<const float> rgba, std::size_t m, TexturedBatch* batch) {
  const std::size_t plane = rgba.size() / 4;
  Copy(rgba, batch->input.data<T>() + m * rgba.size());
  for (const std::size_t n : {2 * m, 2 * (m ^ 1) + 1}) {
    Copy(rgba.first(3 * plane), batch->truth_colors.data<T>() + n * 3 * plane);
    Copy(rgba.subspan(3 * plane), batch->truth_alpha.data<T>() + n * plane);
    batch->cameras[n] = batch->views[m].camera;
  }
}

}  // namespace

Result<TexturedBatch> RenderBatch(nn::Context& context, TexturedStream& stream, int size,
                                  const std::vector<Sample>& models, std::int64_t first) {
  const std::size_t inputs = kViewsOfObject * models.size(), images = 2 * inputs;
  const auto m = static_cast<std::int64_t>(inputs), n = static_cast<std::int64_t>(images);
  TexturedBatch batch{context.Empty({m, 4, size, size}), context.Empty({n, 3, size, size}),
                      context.Empty({n, size, size}), std::vector<Camera>(images),
                      std::vector<TexturedView>(inputs)};
  std::vector<Status> failures(models.size());
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    context.workers().For(models.size(), [&](std::size_t b, std::size_t worker) {
      const std::uint64_t position = static_cast<std::uint64_t>(first) + b;
      const auto rgba = stream.Render(models[b].model, position, worker,
                                      std::span(batch.views).subspan(2 * b, 2));
      failures[b] = rgba.status();
      if (!rgba.ok()) return;
      const std::size_t image = rgba->size() / 2;
      Place<T>(rgba->first(image), 2 * b, &batch);
      Place<T>(rgba->subspan(image), 2 * b + 1, &batch);
    });
  });
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return batch;
}

}  // namespace tilegrad::train
