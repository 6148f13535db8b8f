// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/pictures.h"

#include <memory>
#include <utility>

#include "base/rng.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kShiftStream = 0x7368696674;
constexpr int kPictureChannels = 3;

// How one picture is read: numbers of `image` from [4][size][size] bytes.
struct Placement {
  int size;
  bool mirrored;
  Shift shift;

  // The byte that comes to (x, y) of channel c, or 0 from beyond the picture.
  std::uint8_t At(std::span<const std::uint8_t> image, int c, int y, int x) const {
    const int row = y - shift.y, moved = x - shift.x;
    if (row < 0 || row >= size || moved < 0 || moved >= size) return 0;
    const int column = mirrored ? size - 1 - moved : moved;
    return image[static_cast<std::size_t>((c * size + row) * size + column)];
  }
  template <class T>
  void Read(std::span<const std::uint8_t> image, T* to) const {
    for (int c = 0; c < kPictureChannels; ++c) {
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x)
          *to++ = static_cast<T>(At(image, c, y, x)) * static_cast<T>(1.0 / 255);
      }
    }
  }
};

// A batch under construction.
struct Gathering {
  const LabelledImages& data;
  std::vector<Sample> batch;
  std::vector<Shift> shifts;
  LabelledBatch out;

  void Run(std::size_t i) {
    const Sample& sample = batch[i];
    const Placement placement{data.images.size, sample.mirrored,
                              shifts.empty() ? Shift() : shifts[i]};
    const std::size_t numbers = out.images.elements() / batch.size();
    nn::WithFloatType(out.images.dtype(), [&]<class T>(T) {
      placement.Read(data.images.Image(sample.model, sample.views[0]),
                     out.images.data<T>() + i * numbers);
    });
    out.labels.data<std::int32_t>()[i] = data.labels[static_cast<std::size_t>(sample.model)];
  }
};

}  // namespace

Result<LabelledImages> LoadLabelled(const Dataset& dataset, const std::vector<int>& models,
                                    const Workers& workers, const ProgressSink& progress,
                                    const StopFlag& stop) {
  LabelledImages out;
  TILEGRAD_ASSIGN(out.images, LoadImageStore(dataset, models, workers, progress, stop));
  for (const int m : models)
    out.labels.push_back(dataset.models()[static_cast<std::size_t>(m)].class_index);
  return out;
}

Shift RandomShift(std::uint64_t seed, std::uint64_t position, int most) {
  Rng rng(seed ^ kShiftStream, position);
  const auto draw = [&] {
    return static_cast<int>(rng.Below(static_cast<std::uint64_t>(2 * most + 1))) - most;
  };
  const int x = draw();
  return {x, draw()};
}

BatchWork<LabelledBatch> LabelledWork(nn::Context& context, const LabelledImages& data,
                                      std::vector<Sample> batch, std::vector<Shift> shifts) {
  const auto count = static_cast<std::int64_t>(batch.size()),
             size = static_cast<std::int64_t>(data.images.size);
  const auto work =
      std::make_shared<Gathering>(Gathering{data,
                                            std::move(batch),
                                            std::move(shifts),
                                            {context.Empty({count, kPictureChannels, size, size}),
                                             context.Empty({count}, nn::DType::kI32)}});
  return {work->batch.size(), [work](std::size_t i, std::size_t) { work->Run(i); },
          [work] { return Result<LabelledBatch>(std::move(work->out)); }};
}

LabelledBatch GatherLabelled(nn::Context& context, const LabelledImages& data,
                             std::span<const Sample> batch, std::span<const Shift> shifts) {
  return *MakeNow(
      LabelledWork(context, data, {batch.begin(), batch.end()}, {shifts.begin(), shifts.end()}),
      context.workers());
}

nn::Tensor ColorsOf(nn::Context& context, std::span<const std::uint8_t> images, int size) {
  const auto plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  const std::size_t count = images.size() / (4 * plane);
  nn::Tensor out = context.Empty({static_cast<std::int64_t>(count), kPictureChannels, size, size});
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    for (std::size_t i = 0; i < count; ++i) {
      Placement{size, false, {}}.Read(images.subspan(4 * plane * i, 4 * plane),
                                      out.data<T>() + kPictureChannels * plane * i);
    }
  });
  return out;
}

}  // namespace tilegrad::train
