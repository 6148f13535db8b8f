// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/interpolate.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compat/nvdiffrast/interpolate.cc"
#include <hwy/foreach_target.h>

#include "base/scalar.h"
#include "compat/nvdiffrast/interpolate-inl.h"

#if HWY_ONCE

#include <algorithm>
#include <vector>

#include "base/error.h"
#include "compat/nvdiffrast/interpolate_ref.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

HWY_EXPORT(InterpolateBand);
HWY_EXPORT(InterpolateBandBackward);

template <class T>
Status CheckInput(const InterpolateInput<T>& input) {
  for (const std::int32_t channel : input.diff_attrs) {
    if (channel >= 0 && static_cast<std::size_t>(channel) < input.attributes.channels) continue;
    return InvalidArgument("diff_attrs names attribute {}, but there are {}", channel,
                           input.attributes.channels);
  }
  return CheckFaces(input.faces, input.attributes.vertices);
}

// The attributes of diff_attrs as a separate array, unless they are the first ones anyway.
struct SlopedRows {
  AlignedVector<float> values;
  VertexRows<float> rows;

  explicit SlopedRows(const InterpolateInput<float>& input) : rows(input.attributes) {
    const auto& diff = input.diff_attrs;
    std::size_t first = 0;
    while (first < diff.size() && diff[first] == static_cast<std::int32_t>(first)) ++first;
    if (first == diff.size()) return;
    for (std::size_t row = 0; row < input.attributes.rows(); ++row) {
      const float* from = &input.attributes.values[row * input.attributes.channels];
      for (const std::int32_t channel : diff) values.push_back(from[channel]);
    }
    rows.values = values;
    rows.channels = diff.size();
  }
};

// Runs `work` on all bands; an error if one returns a pixel.
template <class Work>
Status ForBands(const InterpolateInput<float>& input, const Workers& workers, const Work& work) {
  std::vector<std::size_t> bad(input.grid.bands(), kNoPixel);
  const SlopedRows sloped(input);
  workers.For(bad.size(), [&](std::size_t index, std::size_t worker) {
    bad[index] = work(InterpolateTask{input, sloped.rows, input.grid.band(index)}, worker);
  });
  return CheckNoPixel<float>(bad, input.rast, input.faces.size() / 3);
}

// Distributes the sums of a band's faces to the rows of their corners.
void SpreadFaces(const InterpolateTask& task, const BandSums::Adder& faces,
                 BandSums::Adder* vertices) {
  const InterpolateInput<float>& input = task.input;
  const std::size_t n = input.attributes.channels, row = (n + 3) / 4 * 4;
  const std::size_t da = 2 * input.diff_attrs.size(), slopes = (da + 3) / 4 * 4;
  const double* sums = faces.sums();
  for (const std::size_t face : faces.rows()) {
    const double* du = sums + 3 * row;
    for (std::size_t k = 0; k < 3; ++k) {
      double* to = vertices->Row(input.attributes.row(task.band.image, input.faces[3 * face + k]));
      for (std::size_t c = 0; c < n; ++c) to[c] += sums[k * row + c];
      for (std::size_t i = 0; i < da; ++i) {
        const double u = du[i], v = du[slopes + i];
        to[input.diff_attrs[i / 2]] += k == 0 ? u : k == 1 ? v : -(u + v);
      }
    }
    sums += InterpolateSums(input);
  }
}

Status Run(const InterpolateInput<float>& input, const Workers& workers,
           const InterpolateOutput<float>& out) {
  return ForBands(input, workers, [&](const InterpolateTask& task, std::size_t) {
    return HWY_DYNAMIC_DISPATCH(InterpolateBand)(task, out);
  });
}
Status Run(const InterpolateInput<double>& input, const Workers& workers,
           const InterpolateOutput<double>& out) {
  TILEGRAD_TRY(CheckFaceIds(input.rast, input.faces.size() / 3));
  InterpolateRef(input, workers, out);
  return {};
}

Status RunBackward(InterpolateInput<float> input, const InterpolateCotangents<float>& d,
                   const Workers& workers, const InterpolateGradients<float>& out) {
  if (d.d_out_da.empty()) input.diff_attrs = {};
  const bool wanted = !out.d_attributes.empty();
  const std::size_t bands = wanted ? input.grid.bands() : 0, sums = InterpolateSums(input);
  // For the band that each worker is processing.
  BandSums faces(input.faces.size() / 3, sums, workers.size(), workers);
  BandSums vertices(input.attributes.rows(), input.attributes.channels, bands, workers);
  std::vector<AlignedVector<float>> scratch(workers.size());
  TILEGRAD_TRY(ForBands(input, workers, [&](const InterpolateTask& task, std::size_t worker) {
    scratch[worker].resize(sums);
    const auto pull = [&](BandSums::Adder* adder) {
      return HWY_DYNAMIC_DISPATCH(InterpolateBandBackward)(task, d, scratch[worker].data(), adder,
                                                           out);
    };
    if (!wanted) return pull(nullptr);
    BandSums::Adder of_faces(&faces, worker, worker);
    const std::size_t bad = pull(&of_faces);
    BandSums::Adder of_vertices(&vertices, task.band.index, worker);
    SpreadFaces(task, of_faces, &of_vertices);
    of_faces.Clear();
    return bad;
  }));
  if (!wanted) return {};
  std::fill(out.d_attributes.begin(), out.d_attributes.end(), 0.0f);
  vertices.AddTo(out.d_attributes, workers);
  return {};
}
Status RunBackward(const InterpolateInput<double>& input, const InterpolateCotangents<double>& d,
                   const Workers& workers, const InterpolateGradients<double>& out) {
  TILEGRAD_TRY(CheckFaceIds(input.rast, input.faces.size() / 3));
  InterpolateBackwardRef(input, d, workers, out);
  return {};
}

}  // namespace

template <class T>
Status Interpolate(const InterpolateInput<T>& input, const Workers& workers,
                   const InterpolateOutput<T>& out) {
  TILEGRAD_TRY(CheckInput(input));
  return Run(input, workers, out);
}

template <class T>
Status InterpolateBackward(const InterpolateInput<T>& input,
                           const InterpolateCotangents<T>& cotangents, const Workers& workers,
                           const InterpolateGradients<T>& out) {
  TILEGRAD_TRY(CheckInput(input));
  return RunBackward(input, cotangents, workers, out);
}

TILEGRAD_INSTANTIATE(Interpolate);
TILEGRAD_INSTANTIATE(InterpolateBackward);

}  // namespace tilegrad::compat::nvdiffrast
#endif
