// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <vector>

#include "render/frame_layout.h"
#include "render/merge_gradients.h"
#include "render/prepare.h"
#include "render/tile_backward.h"
#include "render/tile_forward.h"
#include "render/validate.h"

namespace tilegrad {
namespace {

// Tasks of each image.
struct BackwardPlan {
  raster::TileGrid grid;    // of bins
  std::size_t bands, bins;  // no bins where alpha has no gradient

  BackwardPlan(const RenderOptions& options, const FrameGradients& d_frame)
      : grid(raster::BinGrid(options.width, options.height)),
        bands(BandGrid(options.width, options.height).count()),
        bins(d_frame.alpha.empty() ? 0 : grid.tiles()) {}
};

bool WantsGeometry(const SceneGradients& wanted) {
  return !wanted.positions.empty() || wanted.camera;
}

// Where faces were cut, geometry moves the attributes at the cut.
raster::BackwardRequest BandRequest(const SceneGradients& wanted, const raster::ScreenMesh& mesh) {
  const bool geometry = WantsGeometry(wanted);
  return {geometry, !wanted.attributes.empty() || (geometry && mesh.was_clipped())};
}

}  // namespace

struct Renderer::Impl {
  explicit Impl(const Workers& w)
      : workers(&w), worker_scratch(static_cast<std::size_t>(w.count())) {}

  // Projects and bins every scene of the batch.
  Status Prepare(std::span<const SceneView> scenes, const RenderOptions& options,
                 const PrepareRequest& request) {
    if (images.size() < scenes.size()) images.resize(scenes.size());
    sound = true;
    workers->For(scenes.size(), [&](std::size_t n, std::size_t) {
      Require(PrepareImage(scenes[n], options, request, *workers, &images[n]));
    });
    return sound ? Status() : ValidateSceneNumbers(scenes);
  }

  void Require(bool holds) {
    if (!holds) sound = false;
  }

  // Calls run(task, worker) for all tiles of `grid` of all images together.
  template <class Run>
  void ForTiles(std::size_t count, const raster::TileGrid& grid, const Run& run) {
    workers->For(count * grid.tiles(), [&](std::size_t index, std::size_t worker) {
      const std::size_t tile = index % grid.tiles();
      run(TileTask{index / grid.tiles(), tile, grid.rect(tile)}, worker);
    });
  }

  Status SumFaces(std::span<const SceneView> scenes, const BackwardInput& input,
                  const BackwardPlan& plan, std::span<const SceneGradients> d_scenes);
  Status Merge(std::span<const SceneView> scenes, const RenderOptions& options,
               const BackwardPlan& plan, std::span<SceneGradients> d_scenes);

  const Workers* workers;
  std::atomic<bool> sound = true;  // false: some task met a number that is an error
  std::vector<ImageScratch> images;
  std::vector<WorkerScratch> worker_scratch;
  std::vector<double> bin_errors;             // of alpha, [image][bin]
  std::vector<BandGradients> band_gradients;  // [image][band]
  std::vector<BinGradients> bin_gradients;    // [image][bin]
};

Status Renderer::Impl::SumFaces(std::span<const SceneView> scenes, const BackwardInput& input,
                                const BackwardPlan& plan,
                                std::span<const SceneGradients> d_scenes) {
  const std::size_t bands = scenes.size() * plan.bands, bins = scenes.size() * plan.bins;
  if (band_gradients.size() < bands) band_gradients.resize(bands);
  if (bin_gradients.size() < bins) bin_gradients.resize(bins);
  sound = true;
  workers->For(bands + bins, [&](std::size_t task, std::size_t w) {
    WorkerScratch& worker = worker_scratch[w];
    if (task < bands) {
      const std::size_t n = task / plan.bands;
      Require(RenderBandBackward(input, images[n], {n, task % plan.bands},
                                 BandRequest(d_scenes[n], images[n].mesh), &worker.band,
                                 &band_gradients[task]));
      return;
    }
    task -= bands;
    const std::size_t n = task / plan.bins, bin = task % plan.bins;
    if (!WantsGeometry(d_scenes[n])) return;
    RenderBinBackward(input, images[n], {n, bin, plan.grid.rect(bin)}, &worker.soft,
                      &bin_gradients[task]);
  });
  return sound ? Status() : ValidateBackwardNumbers(scenes, input.frame, input.d_frame);
}

// Positions and attributes are two tasks each, for the sake of a batch of one.
Status Renderer::Impl::Merge(std::span<const SceneView> scenes, const RenderOptions& options,
                             const BackwardPlan& plan, std::span<SceneGradients> d_scenes) {
  sound = true;
  workers->For(2 * scenes.size(), [&](std::size_t task, std::size_t) {
    const std::size_t n = task / 2;
    const ImageGradients gradients{std::span(band_gradients).subspan(n * plan.bands, plan.bands),
                                   std::span(bin_gradients).subspan(n * plan.bins, plan.bins),
                                   BandRequest(d_scenes[n], images[n].mesh)};
    if (task % 2 == 0) {
      Require(MergeGeometry(scenes[n], options, gradients, &images[n], &d_scenes[n]));
    } else {
      Require(MergeAttributes(scenes[n], gradients, &images[n], &d_scenes[n]));
    }
  });
  return sound ? Status() : ValidateResult(d_scenes);
}

Renderer::Renderer(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Status Renderer::Render(std::span<const SceneView> scenes, const RenderOptions& options,
                        const RenderRequest& request, Frame* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_TRY(ValidateSceneSizes(scenes));
  const int channels = scenes.empty() ? 0 : scenes[0].channels;
  SizeFrame(static_cast<int>(scenes.size()), channels, options, request, frame);
  const raster::TileGrid bins = raster::BinGrid(options.width, options.height);
  impl_->bin_errors.assign(scenes.size() * bins.tiles(), 0.0);
  TILEGRAD_TRY(impl_->Prepare(scenes, options, {true, request.alpha, false}));
  impl_->ForTiles(scenes.size(), bins, [&](const TileTask& task, std::size_t worker) {
    impl_->bin_errors[task.image * bins.tiles() + task.tile] =
        RenderBin(scenes[task.image], options, impl_->images[task.image], task,
                  &impl_->worker_scratch[worker], frame);
  });
  for (const double error : impl_->bin_errors) {
    frame->alpha_error_bound = std::max(frame->alpha_error_bound, error);
  }
  return {};
}

Status Renderer::Backward(std::span<const SceneView> scenes, const RenderOptions& options,
                          const Frame& frame, const FrameGradients& d_frame,
                          std::span<SceneGradients> d_scenes) {
  TILEGRAD_TRY(ValidateBackwardSizes(scenes, options, frame, d_frame, d_scenes));
  TILEGRAD_TRY(impl_->Prepare(scenes, options, {false, !d_frame.alpha.empty(), true}));
  const BackwardPlan plan(options, d_frame);
  TILEGRAD_TRY(impl_->SumFaces(scenes, {options, frame, d_frame}, plan, d_scenes));
  return impl_->Merge(scenes, options, plan, d_scenes);
}

}  // namespace tilegrad
