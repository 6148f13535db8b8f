// SPDX-License-Identifier: Apache-2.0
// The way back from images to faces, from face ids and alpha: attributes by bands of rows,
// alpha by bins.
#pragma once

#include <algorithm>
#include <cstddef>

#include "render/alpha/stage.h"
#include "render/pipeline/image_scratch.h"
#include "render/pipeline/pixel_stage.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// The bands of an image: whole rows, so that faces are cut seldom; short enough to share one large
// image among workers. They depend on the size of the image only.
struct BandGrid {
  int width, height, rows;  // pixels; a band has `rows` rows, the last may have fewer

  BandGrid(int w, int h) : width(w), height(h), rows(std::clamp(kBandPixels / w, 16, 64)) {}
  std::size_t count() const { return static_cast<std::size_t>((height + rows - 1) / rows); }

 private:
  static constexpr int kBandPixels = 1 << 15;
};

// What a task of the backward pass reads.
struct BackwardInput {
  const RenderOptions& options;
  const PipelineFrame& frame;
  const PipelineCotangents& d_frame;
  PixelStage* stage;  // null: cotangents of attributes are images themselves
  AlphaStage* alpha;  // null: alpha has no gradient
};

// One band of one image of the batch.
struct BandTask {
  std::size_t image, band;
};

// Gradients of the faces seen in a band, through their attributes. Returns false, and does nothing
// else, if a number of the frame or its gradients in the band is not finite or out of range.
bool RenderBandBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                        const raster::BackwardRequest& request, WorkerScratch* worker,
                        BandGradients* out);

// Gradients of faces through the alpha of a bin, with a rule.
void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const BinTask& bin,
                       WorkerScratch* worker, BinGradients* out);

}  // namespace tilegrad
