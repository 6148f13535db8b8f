// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "raster/bin.h"
#include "raster/project_ref.h"
#include "raster/soft_mask/soft_mask.h"
#include "render/pipeline/paper_bin.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// Equation 6 over all faces, within RenderOptions::max_alpha_error (AlphaRule::kAllFaces): the
// vector kernels of raster/soft_mask/soft_mask.h. Alpha is 1 in the foreground.
class AllFacesAlpha final : public AlphaStage {
 public:
  explicit AllFacesAlpha(std::size_t workers) : scratch_(workers) {}

  AlphaNeeds needs() const override { return {.soft_tree = true, .transmittance = true}; }
  const char* name() const override { return "equation 6"; }
  void Begin(const RenderOptions& options, std::size_t images) override {
    options_ = &options;
    if (plans_.size() < images) plans_.resize(images);
    for (raster::SoftMaskScratch& scratch : scratch_) scratch.work = {};
  }

  void Prepare(std::size_t n, const ImageScratch& image) override {
    plans_[n] = raster::PlanSoftMask({options_->width, options_->height, options_->delta,
                                      options_->max_alpha_error, image.soft.faces});
  }

  double Forward(const AlphaBin& bin, const AlphaImages& out) override {
    return raster::SoftMaskForward(bin.image.soft, plans_[bin.task.image],
                                   {bin.task.rect, out.face_ids}, {out.alpha, out.transmittance},
                                   &scratch_[bin.worker]);
  }

  void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients* out) override {
    raster::SoftMaskBackward(
        bin.image.soft, plans_[bin.task.image], {bin.task.rect, adjoint.face_ids},
        {adjoint.alpha, adjoint.transmittance, adjoint.d_alpha}, out, &scratch_[bin.worker]);
  }

  raster::SoftWork work() const override {
    raster::SoftWork sum;
    for (const raster::SoftMaskScratch& scratch : scratch_) {
      sum.pairs += scratch.work.pairs;
      sum.powers += scratch.work.powers;
    }
    return sum;
  }

 private:
  const RenderOptions* options_ = nullptr;
  std::vector<raster::SoftMaskPlan> plans_;       // of images
  std::vector<raster::SoftMaskScratch> scratch_;  // of workers
};

// Alpha by the truncated rule of the paper's implementations (AlphaRule::kPaper,
// raster/soft_mask/paper_ref.h): for comparisons, so scalar code. Alpha is 1 in the foreground.

// dL/d(vertices of the screen), pixels.
struct VertexSums {
  std::vector<float> x, y;

  explicit VertexSums(std::size_t vertices) : x(vertices), y(vertices) {}

  // Adds the gradients of a tile's faces; face n of the rule is ids[n] of the mesh.
  void Add(const raster::ScreenMesh& mesh, const std::vector<std::int32_t>& ids,
           const NearFacesT<float>& tile) {
    for (std::size_t n = 0; n < tile.source.size(); ++n) {
      const auto f = static_cast<std::size_t>(ids[tile.source[n]]);
      for (int k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(mesh.vertex(f, k));
        x[v] += tile.faces[n].x[k] * 2 / static_cast<float>(mesh.width);
        y[v] -= tile.faces[n].y[k] * 2 / static_cast<float>(mesh.height);
      }
    }
  }
};

// Sums its own gradients, tile by tile of the image.
class PaperAlpha final : public AlphaStage {
 public:
  AlphaNeeds needs() const override { return {.bounded = false, .own_sums = true}; }
  const char* name() const override { return "the paper's truncated rule"; }
  void Begin(const RenderOptions& options, std::size_t images) override {
    options_ = &options;
    if (images_.size() < images) images_.resize(images);
    const std::size_t bins = raster::BinGrid(options.width, options.height).cells();
    for (std::size_t n = 0; n < images; ++n) images_[n].bins.resize(bins);
  }

  void Prepare(std::size_t n, const ImageScratch& image) override {
    Image* const out = &images_[n];
    out->ids.clear();
    out->faces.clear();
    for (std::size_t f = 0; f < image.mesh.faces(); ++f) {
      if ((image.mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
      out->ids.push_back(static_cast<std::int32_t>(f));
      out->faces.push_back(NdcFaceOf(image.mesh, f));
    }
  }

  double Forward(const AlphaBin& bin, const AlphaImages& out) override {
    PaperForward<float>(images_[bin.task.image].faces, PaperRuleOf(*options_),
                        RegionOf(bin, out.face_ids), out.alpha.data());
    return 0;
  }

  void Backward(const AlphaBin& bin, const AlphaAdjoint& adjoint, BinGradients*) override {
    Image* const image = &images_[bin.task.image];
    image->bins[bin.task.bin] =
        PaperBackward<float>(image->faces, PaperRuleOf(*options_), RegionOf(bin, adjoint.face_ids),
                             adjoint.d_alpha.data());
  }

  void AddToScene(const PipelineScene& scene, std::size_t n, const ImageScratch& scratch,
                  PipelineGradients* d_scene) const override {
    const Image& image = images_[n];
    const raster::ScreenMesh& mesh = scratch.mesh;
    const raster::SquareGrid tiles = raster::TileGrid(mesh.width, mesh.height);
    const raster::SquareGrid bins = raster::BinGrid(mesh.width, mesh.height);
    VertexSums sums(mesh.vertices());
    std::vector<std::size_t> next(bins.cells());  // tile of each bin
    for (std::size_t tile = 0; tile < tiles.cells(); ++tile) {
      const raster::PixelRect rect = tiles.rect(tile);
      const std::size_t bin = bins.cell(rect.x0, rect.y0);
      sums.Add(mesh, image.ids, image.bins[bin][next[bin]++]);
    }
    std::vector<float> d_z(mesh.vertices()), d_clip_t(mesh.clipped.size());
    std::vector<float> d_positions(scene.mesh->positions.size());
    std::vector<raster::CameraPoint<float>> points(scene.mesh->positions.size() / 3, {0, 0, 0});
    Camera d_camera = raster::ZeroCamera<float>();
    raster::ProjectRefBackward<float>(FaceSourceOf(*scene.mesh, *options_), mesh,
                                      {sums.x, sums.y, d_z, d_clip_t}, points, d_positions,
                                      &d_camera);
    for (std::size_t i = 0; i < d_scene->positions.size(); ++i) {
      d_scene->positions[i] += d_positions[i];
    }
    if (d_scene->camera) ForEachCameraPart(kAddPart, d_camera, d_scene->d_camera);
  }

 private:
  // The faces that take part, in order, and the gradients of those near the tiles of a bin.
  struct Image {
    std::vector<std::int32_t> ids;  // of the mesh
    std::vector<raster::NdcFace<float>> faces;
    std::vector<std::vector<NearFacesT<float>>> bins;
  };

  PaperRegion RegionOf(const AlphaBin& bin, std::span<const std::int32_t> face_ids) const {
    return {bin.task.rect, options_->width, options_->height, face_ids.data()};
  }

  const RenderOptions* options_ = nullptr;
  std::vector<Image> images_;
};

}  // namespace

std::unique_ptr<AlphaStage> MakeAllFacesAlpha(std::size_t workers) {
  return std::make_unique<AllFacesAlpha>(workers);
}

std::unique_ptr<AlphaStage> MakePaperAlpha() { return std::make_unique<PaperAlpha>(); }

}  // namespace tilegrad
