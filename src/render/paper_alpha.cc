// SPDX-License-Identifier: Apache-2.0
#include "render/paper_alpha.h"

#include <algorithm>
#include <cstddef>

#include "raster/bin.h"
#include "raster/project_ref.h"
#include "render/frame_layout.h"

namespace tilegrad {
namespace {

using Face = raster::NdcFace<float>;

// One image on the screen: the faces that take part, in their order.
struct PaperImage {
  raster::ScreenMeshBuffers buffers;
  raster::ScreenMesh mesh;
  std::vector<std::int32_t> ids;
  std::vector<Face> faces;

  PaperImage(const SceneView& scene, const RenderOptions& options) {
    raster::Project(FaceSourceOf(scene, options), options.width, options.height, &buffers);
    mesh = buffers.View();
    for (std::size_t f = 0; f < mesh.faces(); ++f) {
      if ((mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
      ids.push_back(static_cast<std::int32_t>(f));
      faces.push_back(NdcFaceOf(mesh, f));
    }
  }
};

// The faces that can count in a tile, in their order, and where they come from.
struct PaperTile {
  std::vector<Face> faces;
  std::vector<std::size_t> source;

  PaperTile(const PaperImage& image, const raster::TileRect& rect, double box) {
    const int width = image.mesh.width, height = image.mesh.height;
    const double grown = box + 1e-5;  // of rounding to float in InPaperBox
    const double x0 = NdcX(double(rect.x0), width) - grown, y1 = NdcY(double(rect.y0), height);
    const double x1 = NdcX(double(rect.x1), width) + grown, y0 = NdcY(double(rect.y1), height);
    for (std::size_t n = 0; n < image.faces.size(); ++n) {
      const Face& f = image.faces[n];
      const auto [left, right] = std::minmax({f.x[0], f.x[1], f.x[2]});
      const auto [bottom, top] = std::minmax({f.y[0], f.y[1], f.y[2]});
      const bool apart = right < x0 || left > x1 || top < y0 - grown || bottom > y1 + grown;
      if (!apart) faces.push_back(f), source.push_back(n);
    }
  }
};

// Calls visit(pixel of the image, x, y) in NDC for the background pixels of a tile.
template <class Visit>
void ForBackground(const raster::TileRect& rect, const Frame& frame, std::size_t image,
                   const Visit& visit) {
  const auto width = static_cast<std::size_t>(frame.width);
  const std::size_t first = image * width * static_cast<std::size_t>(frame.height);
  for (int i = rect.y0; i < rect.y1; ++i) {
    for (int j = rect.x0; j < rect.x1; ++j) {
      const std::size_t pixel = first + static_cast<std::size_t>(i) * width + std::size_t(j);
      if (frame.face_ids[pixel] >= 0) continue;
      visit(pixel, NdcX(static_cast<float>(j) + 0.5f, frame.width),
            NdcY(static_cast<float>(i) + 0.5f, frame.height));
    }
  }
}

// dL/d(corners) of a tile's faces.
struct PaperTileGradients {
  std::vector<std::size_t> source;
  std::vector<Face> d_faces;
};

PaperTileGradients TileBackward(const PaperImage& image, const RenderOptions& options,
                                const raster::TileRect& rect, const Frame& frame, std::size_t n,
                                std::span<const float> d_alpha) {
  PaperTile tile(image, rect, options.paper.box);
  PaperTileGradients out{std::move(tile.source), std::vector<Face>(tile.faces.size())};
  ForBackground(rect, frame, n, [&](std::size_t pixel, float x, float y) {
    if (d_alpha[pixel] == 0) return;
    raster::PaperAlphaRefBackward<float>(tile.faces, x, y, PaperRuleOf(options), d_alpha[pixel],
                                         out.d_faces);
  });
  return out;
}

// Adds b to a, entry by entry.
void AddCamera(const Camera& b, Camera* a) {
  for (int i = 0; i < 9; ++i) a->rotation[i] += b.rotation[i];
  for (int i = 0; i < 3; ++i) a->translation[i] += b.translation[i];
  a->fx += b.fx, a->fy += b.fy, a->cx += b.cx, a->cy += b.cy;
}

void AddToScene(const SceneView& scene, const RenderOptions& options, const PaperImage& image,
                std::span<const PaperTileGradients> tiles, SceneGradients* d_scene) {
  std::vector<float> d_x(image.mesh.vertices()), d_y(d_x.size()), d_z(d_x.size());
  for (const PaperTileGradients& tile : tiles) {
    for (std::size_t n = 0; n < tile.source.size(); ++n) {
      const auto f = static_cast<std::size_t>(image.ids[tile.source[n]]);
      for (int k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(image.mesh.vertex(f, k));
        d_x[v] += tile.d_faces[n].x[k] * 2 / static_cast<float>(options.width);
        d_y[v] -= tile.d_faces[n].y[k] * 2 / static_cast<float>(options.height);
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

std::vector<PaperImage> ProjectAll(std::span<const SceneView> scenes,
                                   const RenderOptions& options) {
  std::vector<PaperImage> images;
  images.reserve(scenes.size());
  for (const SceneView& scene : scenes) images.emplace_back(scene, options);
  return images;
}

}  // namespace

void PaperAlpha(std::span<const SceneView> scenes, const RenderOptions& options,
                const Workers& workers, Frame* frame) {
  const auto images = ProjectAll(scenes, options);
  const raster::TileGrid grid(options.width, options.height);
  std::fill(frame->alpha.begin(), frame->alpha.end(), 1.0f);
  workers.For(scenes.size() * grid.tiles(), [&](std::size_t task, std::size_t) {
    const std::size_t n = task / grid.tiles();
    const raster::TileRect rect = grid.rect(task % grid.tiles());
    const PaperTile tile(images[n], rect, options.paper.box);
    ForBackground(rect, *frame, n, [&](std::size_t pixel, float x, float y) {
      frame->alpha[pixel] = raster::PaperAlphaRef<float>(tile.faces, x, y, PaperRuleOf(options));
    });
  });
}

void PaperAlphaBackward(std::span<const SceneView> scenes, const RenderOptions& options,
                        const Workers& workers, const Frame& frame, std::span<const float> d_alpha,
                        std::span<SceneGradients> d_scenes) {
  const auto images = ProjectAll(scenes, options);
  const raster::TileGrid grid(options.width, options.height);
  std::vector<PaperTileGradients> tiles(scenes.size() * grid.tiles());
  workers.For(tiles.size(), [&](std::size_t task, std::size_t) {
    const std::size_t n = task / grid.tiles();
    tiles[task] =
        TileBackward(images[n], options, grid.rect(task % grid.tiles()), frame, n, d_alpha);
  });
  workers.For(scenes.size(), [&](std::size_t n, std::size_t) {
    AddToScene(scenes[n], options, images[n],
               std::span(tiles).subspan(n * grid.tiles(), grid.tiles()), &d_scenes[n]);
  });
}

}  // namespace tilegrad
