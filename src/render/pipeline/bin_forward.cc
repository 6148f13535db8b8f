// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <limits>

#include "base/clocks.h"
#include "base/prefetch.h"
#include "raster/conventions.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// Calls visit(index in the bin's arrays, index in an image) for each pixel of the bin.
template <class Visit>
void ForEachPixel(const raster::PixelRect& rect, int width, const Visit& visit) {
  for (int i = rect.y0; i < rect.y1; ++i) {
    for (int j = rect.x0; j < rect.x1; ++j) {
      visit(static_cast<std::size_t>((i - rect.y0) * raster::kBinSize + j - rect.x0),
            static_cast<std::size_t>(i) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(j));
    }
  }
}

void WriteFaceIds(const raster::ScreenMesh& mesh, const raster::PixelRect& rect,
                  const std::int32_t* faces, std::int32_t* ids) {
  if (!mesh.was_clipped()) {
    constexpr int kRowsAhead = 4;  // copying a row is faster than memory
    const auto width = static_cast<std::size_t>(rect.x1 - rect.x0);
    for (int i = rect.y0; i < rect.y1; ++i, faces += raster::kBinSize) {
      std::int32_t* to = ids + static_cast<std::ptrdiff_t>(i) * mesh.width + rect.x0;
      if (i + kRowsAhead < rect.y1) PrefetchNumbers(to + kRowsAhead * mesh.width, width);
      std::copy_n(faces, width, to);
    }
    return;
  }
  ForEachPixel(rect, mesh.width, [&](std::size_t from, std::size_t to) {
    const std::int32_t face = faces[from];
    ids[to] = face >= 0 ? mesh.source_face[static_cast<std::size_t>(face)] : face;
  });
}

template <class T>
void FillRows(const raster::PixelRect& rect, int width, T value, T* image) {
  for (int i = rect.y0; i < rect.y1; ++i) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(i) * width;
    std::fill(image + row + rect.x0, image + row + rect.x1, value);
  }
}

// For bins without faces.
void WriteBackground(const raster::PixelRect& rect, int width, std::int32_t* ids, float* depth) {
  FillRows(rect, width, raster::kNoFace, ids);
  if (depth != nullptr) FillRows(rect, width, std::numeric_limits<float>::infinity(), depth);
}

void WriteDepth(const raster::PixelRect& rect, int width, const float* inverse, float* depth) {
  ForEachPixel(rect, width, [&](std::size_t from, std::size_t to) {
    depth[to] = inverse[from] > 0 ? 1.0f / inverse[from] : std::numeric_limits<float>::infinity();
  });
}

// Converts the weights of a clipped piece's corners to those of its source face.
void MixCutWeights(const PipelineScene& scene, const raster::ScreenMesh& mesh,
                   const raster::PixelRect& rect, const std::int32_t* faces, float* w1, float* w2) {
  ForEachPixel(rect, mesh.width, [&](std::size_t from, std::size_t to) {
    if (faces[from] == raster::kNoFace) return;
    const float piece[3] = {1 - w1[to] - w2[to], w1[to], w2[to]};
    float source[3];
    raster::SourceWeights<float>(mesh, scene.mesh->faces, static_cast<std::size_t>(faces[from]),
                                 piece, source);
    w1[to] = source[1];
    w2[to] = source[2];
  });
}

// The images of one scene within a batch.
struct ImageOfFrame {
  std::size_t pixels, n;
  template <class T>
  T* plane(AlignedVector<T>& batch, std::size_t planes) const {
    return batch.empty() ? nullptr : batch.data() + n * planes * pixels;
  }
};

bool AnyFace(const std::int32_t* faces, std::size_t pixels) {
  std::int32_t all = raster::kNoFace;
  for (std::size_t i = 0; i < pixels; ++i) all &= faces[i];
  return all != raster::kNoFace;
}

// Draws what is behind `peeled`, and updates it to this layer.
void PeelBin(const BinInput& input, const BinTask& task, WorkerScratch* worker, float* peeled) {
  worker->behind.assign(raster::kBinSize * raster::kBinSize, 0);
  ForEachPixel(task.rect, input.options.width, [&](std::size_t in_bin, std::size_t in_image) {
    worker->behind[in_bin] = peeled[in_image];
  });
  const ImageScratch& image = input.image;
  raster::PeelVisibility(image.mesh, {image.drawn_faces.storage, image.drawn[task.bin]}, task.rect,
                         worker->behind.data(), &worker->bin);
  ForEachPixel(task.rect, input.options.width, [&](std::size_t in_bin, std::size_t in_image) {
    peeled[in_image] = worker->bin.inverse_depth[in_bin];
  });
}

// Draws a bin: its face ids and depth go to `worker` and to the frame. False if no face is listed:
// then only the frame's are written.
bool WriteVisibility(const BinInput& input, const BinTask& task, const ImageOfFrame& part,
                     WorkerScratch* worker, FrameImages* frame) {
  const raster::PixelRect& rect = task.rect;
  const ImageScratch& image = input.image;
  const int width = input.options.width;
  std::int32_t* const ids = part.plane(frame->face_ids, 1);
  float* const depth = part.plane(frame->depth, 1);
  float* const peeled = part.plane(frame->peeled, 1);
  ++worker->stats.drawn;
  const std::span<const std::int32_t> listed = image.drawn[task.bin];
  if (listed.empty()) {
    WriteBackground(rect, width, ids, depth);
    if (peeled != nullptr) FillRows(rect, width, 0.0f, peeled);
    return false;
  }
  if (peeled == nullptr) {
    raster::ComputeVisibility(image.mesh, {image.drawn_faces.storage, listed}, rect, &worker->bin);
  } else {
    PeelBin(input, task, worker, peeled);
  }
  WriteFaceIds(image.mesh, rect, worker->bin.face, ids);
  if (depth != nullptr) WriteDepth(rect, width, worker->bin.inverse_depth, depth);
  return true;
}

// The destination of a bin's attributes: the frame, or the stage.
raster::PlanarView<float> AttributeTarget(const BinInput& input, const BinTask& task,
                                          const ImageOfFrame& part, WorkerScratch* worker) {
  const auto channels = static_cast<std::size_t>(input.image.attributes.channels);
  if (input.stage != nullptr) {
    const auto plane = static_cast<std::size_t>(raster::kBinSize * (task.rect.y1 - task.rect.y0));
    const std::size_t size = channels * plane;
    if (worker->varyings.size() < size) worker->varyings.resize(size);
    return {worker->varyings.data(), static_cast<std::ptrdiff_t>(plane), raster::kBinSize};
  }
  const auto row = static_cast<std::ptrdiff_t>(input.options.width);
  float* attributes =
      input.attributes == nullptr ? nullptr : part.plane(*input.attributes, channels);
  if (attributes != nullptr) attributes += task.rect.y0 * row + task.rect.x0;
  return {attributes, static_cast<std::ptrdiff_t>(part.pixels), row};
}

void InterpolateBin(const BinInput& bin, const BinTask& task, const ImageOfFrame& part, bool drawn,
                    WorkerScratch* worker, FrameImages* frame) {
  const auto row = static_cast<std::ptrdiff_t>(bin.options.width);
  const raster::PixelRect& rect = task.rect;
  const raster::PlanarView<float> target = AttributeTarget(bin, task, part, worker);
  float* barycentrics = part.plane(frame->barycentrics, 2);
  raster::InterpolateInput input{&bin.image.mesh, bin.image.attributes, bin.options.interpolation,
                                 barycentrics != nullptr};
  if (target.data == nullptr) input.attributes.channels = 0;
  ++worker->stats.interpolated;
  const raster::FaceRows rows{worker->bin.face, raster::kBinSize, rect.x0, rect.y0, rect.y1};
  const raster::InterpolateOutput out{
      target,
      {barycentrics == nullptr ? nullptr : barycentrics + rect.y0 * row + rect.x0,
       static_cast<std::ptrdiff_t>(part.pixels), row},
      rect.x1 - rect.x0};
  if (!drawn) {
    raster::InterpolateBackground(input, rows, out);
    return;
  }
  raster::Interpolate(input, rows, out, &worker->interpolate);
  if (barycentrics != nullptr && bin.image.mesh.was_clipped()) {
    MixCutWeights(bin.scene, bin.image.mesh, rect, worker->bin.face, barycentrics,
                  barycentrics + part.pixels);
  }
}

void RunStage(const BinInput& bin, const BinTask& task, bool any_face, WorkerScratch* worker) {
  const raster::PixelRect& rect = task.rect;
  bin.stage->Forward(
      {.image = task.image,
       .band = 0,
       .worker = worker->index,
       .mesh = &bin.image.mesh,
       .attributes = bin.image.attributes,
       .rows = {worker->bin.face, raster::kBinSize, rect.x0, rect.y0, rect.y1},
       .columns = rect.x1 - rect.x0,
       .first = static_cast<std::size_t>(rect.y0) * static_cast<std::size_t>(bin.options.width) +
                static_cast<std::size_t>(rect.x0),
       .varyings = worker->varyings.data(),
       .any_face = any_face});
}

// Alpha of a bin. Returns the error spent.
double RunAlpha(const BinInput& input, const BinTask& task, const ImageOfFrame& part,
                WorkerScratch* worker, FrameImages* frame) {
  const auto plane = [&](auto& batch) {
    return std::span(part.plane(batch, 1), batch.empty() ? 0 : part.pixels);
  };
  ++worker->stats.alpha_parts;
  return input.alpha->Forward(
      {input.image, task, worker->index},
      {plane(frame->face_ids), plane(frame->alpha), plane(frame->transmittance)});
}

}  // namespace

double RenderBin(const BinInput& input, const BinTask& task, WorkerScratch* worker,
                 FrameImages* frame) {
  RenderTimes* const times = &worker->times;
  StageClock clock;
  const ImageOfFrame part{
      static_cast<std::size_t>(frame->width) * static_cast<std::size_t>(frame->height), task.image};
  const bool drawn = WriteVisibility(input, task, part, worker, frame);
  clock.Lap(&times->visibility);
  const auto pixels = static_cast<std::size_t>(raster::kBinSize * (task.rect.y1 - task.rect.y0));
  const bool to_stage = input.stage != nullptr && drawn && AnyFace(worker->bin.face, pixels);
  const bool to_frame = input.attributes != nullptr && !input.attributes->empty();
  if (to_stage || to_frame || !frame->barycentrics.empty()) {
    InterpolateBin(input, task, part, drawn, worker, frame);
  }
  clock.Lap(&times->interpolate);
  if (input.stage != nullptr) RunStage(input, task, to_stage, worker);
  clock.Lap(&times->stage);
  if (input.alpha == nullptr) return 0;
  const double spent = RunAlpha(input, task, part, worker, frame);
  clock.Lap(&times->alpha);
  return spent;
}

}  // namespace tilegrad
