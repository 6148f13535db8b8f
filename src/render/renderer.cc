// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "render/frame_layout.h"
#include "render/prepare.h"
#include "render/tile_backward.h"
#include "render/tile_forward.h"
#include "render/validate.h"

namespace tilegrad {

struct Renderer::Impl {
  explicit Impl(const Workers& w)
      : workers(&w), worker_scratch(static_cast<std::size_t>(w.count())) {}

  // Projects and bins every scene of the batch.
  void Prepare(std::span<const SceneView> scenes, const RenderOptions& options,
               const PrepareRequest& request) {
    if (images.size() < scenes.size()) images.resize(scenes.size());
    workers->For(scenes.size(), [&](std::size_t n, std::size_t) {
      PrepareImage(scenes[n], options, request, &images[n]);
    });
  }

  // Calls run(task, worker) for all tiles of `grid` of all images together.
  template <class Run>
  void ForTiles(std::size_t count, const raster::TileGrid& grid, const Run& run) {
    workers->For(count * grid.tiles(), [&](std::size_t index, std::size_t worker) {
      const std::size_t tile = index % grid.tiles();
      run(TileTask{index / grid.tiles(), tile, grid.rect(tile)}, worker);
    });
  }

  void Merge(const SceneView& scene, const RenderOptions& options, std::size_t n,
             SceneGradients* d_scene);

  const Workers* workers;
  std::vector<ImageScratch> images;
  std::vector<WorkerScratch> worker_scratch;
  std::vector<TileGradients> tile_gradients;  // [image][tile]
  std::vector<double> bin_errors;             // of alpha, [image][bin]
};

void Renderer::Impl::Merge(const SceneView& scene, const RenderOptions& options, std::size_t n,
                           SceneGradients* d_scene) {
  ImageScratch& image = images[n];
  ClearImageGradients(scene, *d_scene, &image);
  const std::size_t tiles = raster::TileGrid(options.width, options.height).tiles();
  const std::span<float> d_attributes =
      image.mesh.was_clipped() ? std::span<float>(image.d_attributes) : d_scene->attributes;
  MergeTileGradients(image, std::span(tile_gradients).subspan(n * tiles, tiles), worker_scratch,
                     d_attributes, {image.d_x, image.d_y, image.d_inverse_depth, image.d_clip_t});
  FinishImageGradients(scene, options, &image, d_scene);
}

Renderer::Renderer(const Workers& workers) : impl_(std::make_unique<Impl>(workers)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Status Renderer::Render(std::span<const SceneView> scenes, const RenderOptions& options,
                        const RenderRequest& request, Frame* frame) {
  TILEGRAD_TRY(ValidateOptions(options));
  TILEGRAD_TRY(ValidateScenes(scenes));
  const int channels = scenes.empty() ? 0 : scenes[0].channels;
  SizeFrame(static_cast<int>(scenes.size()), channels, options, request, frame);
  const raster::TileGrid bins = raster::BinGrid(options.width, options.height);
  impl_->bin_errors.assign(scenes.size() * bins.tiles(), 0.0);
  impl_->Prepare(scenes, options, {true, request.alpha, false});
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
  TILEGRAD_TRY(ValidateBackward(scenes, options, frame, d_frame, d_scenes));
  impl_->Prepare(scenes, options, {false, !d_frame.alpha.empty(), true});
  for (WorkerScratch& worker : impl_->worker_scratch) worker.ClearGradients();
  const raster::TileGrid grid(options.width, options.height);
  const std::size_t tiles = grid.tiles();
  impl_->tile_gradients.resize(scenes.size() * tiles);
  impl_->ForTiles(scenes.size(), grid, [&](const TileTask& task, std::size_t worker) {
    const SceneGradients& wanted = d_scenes[task.image];
    const BackwardRequest request{!wanted.positions.empty() || wanted.camera,
                                  !wanted.attributes.empty()};
    impl_->tile_gradients[task.image * tiles + task.tile] =
        RenderTileBackward(options, impl_->images[task.image], task, frame, d_frame, request,
                           worker, &impl_->worker_scratch[worker]);
  });
  impl_->workers->For(scenes.size(), [&](std::size_t n, std::size_t) {
    impl_->Merge(scenes[n], options, n, &d_scenes[n]);
  });
  return ValidateResult(d_scenes);
}

}  // namespace tilegrad
