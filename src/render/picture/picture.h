// SPDX-License-Identifier: Apache-2.0
// One picture of a scene for people: anti-aliased colour and alpha, and the exact images beside it.
// Not differentiable.
#pragma once

#include <string>
#include <vector>

#include "render/picture/mesh_scene.h"
#include "render/renderer.h"

namespace tilegrad {

struct PictureRequest {
  int width = 0, height = 0;  // pixels
  // Colour and alpha: the picture is rendered at this many times its size, one sample a pixel, and
  // averaged over squares; >= 1, and size times this at most 16384.
  int supersampling = 1;
  bool color = true;
  bool alpha = false;  // without colour; with colour it comes anyway
  bool depth = false, normals = false, uv = false, face_ids = false;  // at pixel centres
  double soft_delta = 0;  // > 0: alpha is equation 6 with this delta (RenderOptions), not the share
                          // that is covered
  FaceCulling culling = FaceCulling::kNone;
  // What the scene's surfaces let through; null: nothing. A soft alpha knows no holes: with it, all
  // is opaque. The exact images show the nearest face that is not cut out.
  const SceneCover* cover = nullptr;
};

// Planar as a Frame; empty if not requested.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> color;    // [3,H,W] in the scene's colour space, clamped to [0, 1], the mean
                               // over the covered part of a pixel; 0 where nothing is
  std::vector<float> alpha;    // [H,W] the covered share, or soft
  std::vector<float> depth;    // [H,W] +infinity where nothing is
  std::vector<float> normals;  // [3,H,W] unit, world
  std::vector<float> uv;       // [2,H,W]
  std::vector<std::int32_t> face_ids;  // [H,W] -1 where nothing is
  std::vector<PlanReport> plans;       // of each pass: colour and alpha, then the exact images
};

// The one supersampler: colour and alpha of image 0 of `samples`, averaged over squares of scale x
// scale samples. Alpha is that of the samples if they have it, else the covered share.
void AverageSamples(const Images& samples, int scale, Picture* picture);

class PictureRenderer {
 public:
  explicit PictureRenderer(const Workers& workers)
      : renderer_(RendererOn(workers)), layers_(workers) {}

  // `scene.camera` is that of the picture's size. Errors: those of Renderer::Render, and a
  // request out of range.
  Status Render(const Scene& scene, const PictureRequest& request, Picture* picture);

 private:
  Status RenderColor(Scene scene, const PictureRequest& request, Picture* picture);
  Status RenderExact(const Scene& scene, const PictureRequest& request, Picture* picture);

  Status RenderColorLayers(const Scene& scene, const PictureRequest& request, Picture* picture);
  Status RenderExactLayers(const Scene& scene, const PictureRequest& request, const Outputs& images,
                           Picture* picture);
  void AverageLayers(const PictureRequest& request, Picture* picture) const;

  Renderer renderer_;
  Frame frame_;
  LayerRenderer layers_;
  std::vector<float> seen_;     // [3,H,W] of all layers
  std::vector<float> through_;  // [H,W] share of what is behind them that is seen
};

}  // namespace tilegrad
