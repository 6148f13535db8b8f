// SPDX-License-Identifier: Apache-2.0
#include "render/alpha/paper_alpha.h"

#include <algorithm>
#include <cstddef>

#include "raster/bin.h"
#include "raster/project_ref.h"
#include "render/pipeline/frame_layout.h"

namespace tilegrad {
namespace {

// One image on the screen: the faces that take part, in their order.
struct PaperImage {
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  std::vector<std::int32_t> ids;
  std::vector<raster::NdcFace<float>> faces;

  PaperImage(const PipelineScene& scene, const RenderOptions& options) {
    raster::Project(FaceSourceOf(scene, options), options.width, options.height, &buffers);
    mesh = buffers.View();
    for (std::size_t f = 0; f < mesh.faces(); ++f) {
      if ((mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
      ids.push_back(static_cast<std::int32_t>(f));
      faces.push_back(NdcFaceOf(mesh, f));
    }
  }
};

// Image n of the batch.
PaperTile TileOf(const raster::PixelRect& rect, const PipelineFrame& frame, std::size_t n) {
  return {rect, frame.width, frame.height,
          frame.face_ids.data() +
              n * static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height)};
}

NearFacesT<float> FacesNearTile(const PaperImage& image, const raster::PixelRect& rect,
                                double box) {
  return FacesNear<float>(image.faces, rect, image.mesh.width, image.mesh.height, box);
}

// Adds b to a, entry by entry.
void AddCamera(const Camera& b, Camera* a) {
  for (int i = 0; i < 9; ++i) a->rotation[i] += b.rotation[i];
  for (int i = 0; i < 3; ++i) a->translation[i] += b.translation[i];
  a->fx += b.fx, a->fy += b.fy, a->cx += b.cx, a->cy += b.cy;
}

void AddToScene(const PipelineScene& scene, const RenderOptions& options, const PaperImage& image,
                std::span<const NearFacesT<float>> tiles, PipelineGradients* d_scene) {
  std::vector<float> d_x(image.mesh.vertices()), d_y(d_x.size()), d_z(d_x.size());
  for (const NearFacesT<float>& tile : tiles) {
    for (std::size_t n = 0; n < tile.source.size(); ++n) {
      const auto f = static_cast<std::size_t>(image.ids[tile.source[n]]);
      for (int k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(image.mesh.vertex(f, k));
        d_x[v] += tile.faces[n].x[k] * 2 / static_cast<float>(options.width);
        d_y[v] -= tile.faces[n].y[k] * 2 / static_cast<float>(options.height);
      }
    }
  }
  std::vector<float> d_clip_t(image.mesh.clipped.size()), d_positions(scene.positions.size());
  std::vector<raster::CameraPoint<float>> points(scene.positions.size() / 3, {0, 0, 0});
  Camera d_camera = raster::ZeroCamera<float>();
  raster::ProjectRefBackward<float>(FaceSourceOf(scene, options), image.mesh,
                                    {d_x, d_y, d_z, d_clip_t}, points, d_positions, &d_camera);
  for (std::size_t i = 0; i < d_scene->positions.size(); ++i) {
    d_scene->positions[i] += d_positions[i];
  }
  if (d_scene->camera) AddCamera(d_camera, &d_scene->d_camera);
}

std::vector<PaperImage> ProjectAll(std::span<const PipelineScene> scenes,
                                   const RenderOptions& options) {
  std::vector<PaperImage> images;
  images.reserve(scenes.size());
  for (const PipelineScene& scene : scenes) images.emplace_back(scene, options);
  return images;
}

}  // namespace

void PaperAlpha(std::span<const PipelineScene> scenes, const RenderOptions& options,
                const Workers& workers, PipelineFrame* frame) {
  const auto images = ProjectAll(scenes, options);
  const raster::SquareGrid grid = raster::TileGrid(options.width, options.height);
  std::fill(frame->alpha.begin(), frame->alpha.end(), 1.0f);
  const std::size_t pixels =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  workers.For(scenes.size() * grid.cells(), [&](std::size_t task, std::size_t) {
    const std::size_t n = task / grid.cells();
    const raster::PixelRect rect = grid.rect(task % grid.cells());
    PaperTileAlpha(FacesNearTile(images[n], rect, options.paper_box), PaperRuleOf(options),
                   TileOf(rect, *frame, n), frame->alpha.data() + n * pixels);
  });
}

void PaperAlphaBackward(std::span<const PipelineScene> scenes, const RenderOptions& options,
                        const Workers& workers, const PipelineFrame& frame,
                        std::span<const float> d_alpha, std::span<PipelineGradients> d_scenes) {
  const auto images = ProjectAll(scenes, options);
  const raster::SquareGrid grid = raster::TileGrid(options.width, options.height);
  std::vector<NearFacesT<float>> tiles(scenes.size() * grid.cells());
  const std::size_t pixels =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  workers.For(tiles.size(), [&](std::size_t task, std::size_t) {
    const std::size_t n = task / grid.cells();
    const raster::PixelRect rect = grid.rect(task % grid.cells());
    tiles[task] =
        PaperTileBackward(FacesNearTile(images[n], rect, options.paper_box), PaperRuleOf(options),
                          TileOf(rect, frame, n), d_alpha.data() + n * pixels);
  });
  workers.For(scenes.size(), [&](std::size_t n, std::size_t) {
    AddToScene(scenes[n], options, images[n],
               std::span(tiles).subspan(n * grid.cells(), grid.cells()), &d_scenes[n]);
  });
}

}  // namespace tilegrad
