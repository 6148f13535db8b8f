// SPDX-License-Identifier: Apache-2.0
// Shading as a stage of the renderer: gathers the foreground pixels of a strip into runs of one
// surface (run.h), shades them and scatters the results to the images; backward, to cotangents of
// the interpolated values, and sums per band.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/frame_images.h"
#include "render/pipeline/records.h"
#include "render/shading/plan.h"
#include "render/shading/run.h"

namespace tilegrad {

// Adjacent pixels in a row of a strip whose faces have the same surface.
struct PixelSegment {
  std::int32_t surface;
  std::int32_t at;     // of the first pixel in the strip
  std::int32_t count;  // up to kRunPixels
};

// Segments of one surface, at most kRunPixels pixels together.
struct PixelRun {
  std::span<const PixelSegment> segments;
  std::size_t count;  // pixels
  std::int32_t surface() const { return segments[0].surface; }
};

// A scene of the batch, prepared for shading.
struct StageScene {
  const Scene* scene = nullptr;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;           // unit directions
  std::vector<float> inverse_lengths;  // of the lights' directions
  shade::ShPolynomial sh = {};
  shade::Vec3<float> eye = {};
  std::vector<const shade::TexturePyramid*> textures;
};

// The sums of one band of an image.
struct StageBand {
  SceneSums sums;
  std::vector<std::vector<shade::TexelShare>> shares;  // of each texture
};

// Scratch of one worker.
struct StageWorker {
  std::vector<PixelSegment> segments;
  RunValues values;
  RunCotangents d;
  ShadeWork work;
};

class ShadeStage : public PixelStage {
 public:
  explicit ShadeStage(std::size_t workers);

  // Start a call; the caller keeps all arguments alive.
  void BeginForward(const ForwardPlan& plan, std::span<const StageScene> scenes,
                    const RenderOptions& options, FrameImages* frame);
  void BeginBackward(const BackwardPlan& plan, std::span<const StageScene> scenes,
                     const RenderOptions& options, const FrameGradients& d_frame);

  void Forward(const PixelStrip& strip) override;
  bool BeginBand(std::size_t image, std::size_t band, std::size_t first,
                 std::size_t pixels) override;
  void Backward(const PixelStrip& strip, const raster::PlanarView<float>& d_varyings) override;

  std::span<const StageBand> bands(std::size_t image) const {
    return std::span(bands_).subspan(image * bands_of_image_, bands_of_image_);
  }
  ShadeWork work() const;                // of this call
  bool sound() const { return sound_; }  // false: a cotangent was not finite

 private:
  void Begin(std::span<const StageScene> scenes, const RenderOptions& options);
  void ForwardRun(const PixelStrip& strip, const PixelRun& run, StageWorker* worker);
  void BackwardRun(const PixelStrip& strip, const PixelRun& run,
                   const raster::PlanarView<float>& d_varyings, StageWorker* worker);
  RunScene RunSceneOf(const StageScene& scene, std::int32_t surface) const;
  void GatherInputs(const PixelStrip& strip, const PixelRun& run, const VaryingSet& set,
                    const ShadeSteps& steps, StageWorker* worker) const;
  void GatherCotangentsOf(const PixelStrip& strip, const PixelRun& run, RunCotangents* d) const;
  void AddUvCotangents(const PixelStrip& strip, const PixelRun& run, RunCotangents* d) const;
  shade::TexelShare* NewShares(const RunScene& scene, std::size_t count, StageBand* band) const;
  void DepthAdjoint(const PixelStrip& strip, const PixelRun& run, StageWorker* worker,
                    SceneSums* sums);
  void ScatterCotangents(const PixelStrip& strip, const PixelRun& run,
                         const raster::PlanarView<float>& d_varyings, const RunCotangents& d) const;

  const ForwardPlan* forward_ = nullptr;
  const BackwardPlan* backward_ = nullptr;
  std::span<const StageScene> scenes_;
  const RenderOptions* options_ = nullptr;
  std::size_t pixels_ = 0;  // of an image
  FrameImages* frame_ = nullptr;
  const FrameGradients* d_frame_ = nullptr;
  std::vector<std::unique_ptr<StageWorker>> workers_;
  std::vector<StageBand> bands_;  // [image][band]
  std::size_t bands_of_image_ = 0;
  std::atomic<bool> sound_ = true;
};

}  // namespace tilegrad
