// SPDX-License-Identifier: Apache-2.0
#include "nn/cases/cases.h"

namespace tilegrad::nn {
namespace {

struct ModeCase {
  const char* name;
  PadMode mode;
};

void AddPadding(CaseList& list) {
  const Shape shape = {list.Extent(2), list.Extent(3), 2 + list.Extent(2), 2 + list.Extent(9)};
  for (const auto& [name, mode] :
       {ModeCase{"zero", PadMode::kZero}, ModeCase{"circular", PadMode::kCircular},
        ModeCase{"replicate", PadMode::kReplicate}}) {
    list.Add({std::string("pad image ") + name,
              [how = mode](const Inputs& v) {
                return Square(PadImage(v[0], {2, 1, 0, 2}, how));
              },
              {{shape}},
              48});
    list.Add({std::string("pad axis 0 ") + name,
              [how = mode](const Inputs& v) { return Square(Pad(v[0], 0, 1, 2, how)); },
              {{{3, list.Extent(11)}}},
              48});
  }
}

void AddResizing(CaseList& list) {
  for (const auto& [name, mode] :
       {std::pair{"nearest", ResizeMode::kNearest}, std::pair{"bilinear", ResizeMode::kBilinear}}) {
    const Shape shape = {list.Extent(2), list.Extent(2), list.Extent(5), list.Extent(9)};
    const ImageSize size{list.Extent(7), list.Extent(12)};
    list.Add({std::string("resize ") + name,
              [how = mode, size](const Inputs& v) { return Square(Resize(v[0], size, how)); },
              {{shape}},
              64});
  }
}

void AddPooling(CaseList& list) {
  PoolOptions options{.kernel = static_cast<int>(list.Extent(3)),
                      .stride = static_cast<int>(list.Extent(3))};
  options.padding =
      static_cast<int>(list.rng.Below(static_cast<std::uint64_t>(options.kernel / 2 + 1)));
  const Shape shape = {list.Extent(2), list.Extent(2), 2 + list.Extent(4), 2 + list.Extent(9)};
  const InputSpec x = {shape, -0.7, 1, /*separated=*/true};
  const std::string what = " kernel " + std::to_string(options.kernel) + " stride " +
                           std::to_string(options.stride) + " padding " +
                           std::to_string(options.padding);
  list.Add({"average pooling" + what,
            [=](const Inputs& v) { return Square(AvgPool2d(v[0], options)); },
            {x},
            64});
  list.Add({"max pooling" + what,
            [=](const Inputs& v) { return Square(MaxPool2d(v[0], options)); },
            {x},
            64});
}

}  // namespace

void AddImageCases(CaseList& list) {
  AddPadding(list);
  for (int trial = 0; trial < 4; ++trial) AddResizing(list);
  for (int trial = 0; trial < 4; ++trial) AddPooling(list);
}

}  // namespace tilegrad::nn
