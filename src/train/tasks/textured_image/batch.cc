// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/batch.h"

#include <algorithm>
#include <memory>
#include <utility>

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

// A batch under construction.
struct Rendering {
  TexturedStream& stream;
  std::vector<Sample> models;
  std::uint64_t first;
  TexturedBatch batch;
  std::vector<Status> failures = std::vector<Status>(models.size());

  void Run(std::size_t b, std::size_t lane) {
    const auto rgba =
        stream.Render(models[b].model, first + b, lane, std::span(batch.views).subspan(2 * b, 2));
    failures[b] = rgba.status();
    if (!rgba.ok()) return;
    const std::size_t image = rgba->size() / 2;
    nn::WithFloatType(batch.input.dtype(), [&]<class T>(T) {
      Place<T>(rgba->first(image), 2 * b, &batch);
      Place<T>(rgba->subspan(image), 2 * b + 1, &batch);
    });
  }
  Result<TexturedBatch> Finish() {
    for (const Status& failure : failures) TILEGRAD_TRY(failure);
    batch.stream_seconds = stream.TakeSeconds();
    return std::move(batch);
  }
};

}  // namespace

BatchWork<TexturedBatch> RenderWork(nn::Context& context, TexturedStream& stream, int size,
                                    std::vector<Sample> models, std::int64_t first) {
  const std::size_t objects = models.size(), inputs = kViewsOfObject * objects, images = 2 * inputs;
  const auto m = static_cast<std::int64_t>(inputs), n = static_cast<std::int64_t>(images);
  TexturedBatch batch{context.Empty({m, 4, size, size}), context.Empty({n, 3, size, size}),
                      context.Empty({n, size, size}), std::vector<Camera>(images),
                      std::vector<TexturedView>(inputs)};
  const auto work = std::make_shared<Rendering>(
      Rendering{stream, std::move(models), static_cast<std::uint64_t>(first), std::move(batch)});
  return {objects, [work](std::size_t b, std::size_t lane) { work->Run(b, lane); },
          [work] { return work->Finish(); }};
}

Result<TexturedBatch> RenderBatch(nn::Context& context, TexturedStream& stream, int size,
                                  const std::vector<Sample>& models, std::int64_t first) {
  return MakeNow(RenderWork(context, stream, size, models, first), context.workers());
}

}  // namespace tilegrad::train
