// SPDX-License-Identifier: Apache-2.0
#include "cli/sample_pictures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image_file.h"
#include "io/webp_animation.h"
#include "render/picture/composite.h"
#include "train/tasks/gan/sheet.h"

namespace tilegrad::cli {
namespace {

constexpr int kTurning = 8, kTurningColumns = 4, kTurningSize = 112, kTurningFrames = 30;
constexpr int kStripSize = 96, kAnimationSize = 192, kAnimated = 6, kSampleFrameMilliseconds = 100,
              kSampleQuality = 70;

double Difference(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / 255 / static_cast<double>(a.pixels.size());
}

double LargestStep(std::span<const ImageU8> row) {
  double sum = 0, largest = 0;
  for (std::size_t k = 1; k < row.size(); ++k) {
    const double step = Difference(row[k - 1], row[k]);
    sum += step;
    largest = std::max(largest, step);
  }
  return sum > 0 ? largest * static_cast<double>(row.size() - 1) / sum : 1;
}

// `steps` codes from `from`, which is the first of them, towards `to`, and that if `whole`.
std::vector<float> CodesBetween(std::span<const float> from, std::span<const float> to, int steps,
                                bool whole) {
  std::vector<float> codes;
  for (int i = 0; i < steps + (whole ? 1 : 0); ++i) {
    const auto code = train::BetweenCodes(from, to, static_cast<double>(i) / steps);
    codes.insert(codes.end(), code.begin(), code.end());
  }
  return codes;
}

}  // namespace

Status AnimateSamples(std::span<const Mesh> meshes, const Path& file, const Workers& workers) {
  const auto some = meshes.first(std::min<std::size_t>(meshes.size(), kTurning));
  const int columns = std::min<int>(kTurningColumns, static_cast<int>(some.size()));
  std::vector<ImageU8> frames;
  for (int frame = 0; frame < kTurningFrames; ++frame) {
    const Camera camera = train::SheetCamera(kTurningSize, 360.0 * frame / kTurningFrames);
    TILEGRAD_ASSIGN(const auto pictures, train::DrawObjects(some, camera, kTurningSize, workers));
    frames.push_back(TileImages(pictures, columns, 0));
  }
  return io::SaveWebpAnimation(file, frames,
                               {.frame_ms = kSampleFrameMilliseconds, .quality = kSampleQuality});
}

Result<InterpolationSteps> DrawInterpolation(const InterpolationJob& job,
                                             train::GeneratorModel& model, const Workers& workers) {
  std::vector<ImageU8> cells, frames;
  InterpolationSteps out;
  for (std::size_t i = 0; i < job.codes.size(); ++i) {
    const std::vector<float>& to = job.codes[(i + 1) % job.codes.size()];
    TILEGRAD_ASSIGN(const auto meshes,
                    model.Generate(CodesBetween(job.codes[i], to, job.steps, true)));
    TILEGRAD_ASSIGN(auto row, train::DrawObjects(meshes, train::SheetCamera(kStripSize, 0),
                                                 kStripSize, workers));
    const double ratio = LargestStep(row);
    out.mean += ratio / static_cast<double>(job.codes.size());
    out.largest = std::max(out.largest, ratio);
    for (ImageU8& cell : row) cells.push_back(std::move(cell));
    if (i >= kAnimated) continue;
    TILEGRAD_ASSIGN(const auto between,
                    model.Generate(CodesBetween(job.codes[i], to, 2 * job.steps, false)));
    TILEGRAD_ASSIGN(auto large, train::DrawObjects(between, train::SheetCamera(kAnimationSize, 0),
                                                   kAnimationSize, workers));
    for (ImageU8& frame : large) frames.push_back(std::move(frame));
  }
  TILEGRAD_TRY(io::SavePng(job.strip, TileImages(cells, job.steps + 1, 2)));
  TILEGRAD_TRY(io::SaveWebpAnimation(
      job.animation, frames, {.frame_ms = kSampleFrameMilliseconds, .quality = kSampleQuality}));
  return out;
}

}  // namespace tilegrad::cli
