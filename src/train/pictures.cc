// SPDX-License-Identifier: Apache-2.0
#include "train/pictures.h"

#include <algorithm>

#include "render/renderer.h"

namespace tilegrad::train {
namespace {

constexpr int kSamples = 3;  // a side of a pixel
constexpr int kGap = 4;      // pixels between tiles

Camera Scaled(Camera camera, float factor) {
  camera.fx *= factor, camera.fy *= factor, camera.cx *= factor, camera.cy *= factor;
  return camera;
}

std::uint8_t ToByte(float unit) {
  return static_cast<std::uint8_t>(255 * std::clamp(unit, 0.0f, 1.0f) + 0.5f);
}

// The mean over kSamples^2 samples of image n of the frame; samples without a face show the paper.
ImageU8 Resolve(const Images& frame, std::size_t n, int size) {
  ImageU8 out(size, size, 3);
  const auto wide = static_cast<std::size_t>(frame.width),
             plane = wide * static_cast<std::size_t>(frame.height);
  const float* rgb = frame.color.data() + 3 * plane * n;
  const std::int32_t* ids = frame.face_ids.data() + plane * n;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      float sum[3] = {};
      for (int s = 0; s < kSamples * kSamples; ++s) {
        const std::size_t p = static_cast<std::size_t>(y * kSamples + s / kSamples) * wide +
                              static_cast<std::size_t>(x * kSamples + s % kSamples);
        for (std::size_t c = 0; c < 3; ++c)
          sum[c] += ids[p] < 0 ? kPaper : std::clamp(rgb[c * plane + p], 0.0f, 1.0f);
      }
      for (int c = 0; c < 3; ++c) out.at(x, y)[c] = ToByte(sum[c] / (kSamples * kSamples));
    }
  }
  return out;
}

std::vector<float> Colors(const Mesh& mesh) {
  std::vector<float> colors(3 * mesh.positions.size(), 1.0f);
  for (std::size_t v = 0; v < mesh.colors.size(); ++v) {
    for (int c = 0; c < 3; ++c) colors[3 * v + static_cast<std::size_t>(c)] = mesh.colors[v][c];
  }
  return colors;
}

}  // namespace

Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const PictureRequest& request,
                                      const Workers& workers) {
  TILEGRAD_TRY(Validate(mesh));
  const std::vector<float> colors = Colors(mesh);
  Scene scene;
  scene.colors = {colors, Rate::kVertex};
  if (!mesh.positions.empty()) scene.positions = {&mesh.positions[0].x, 3 * mesh.positions.size()};
  if (!mesh.faces.empty()) scene.faces = {mesh.faces[0].data(), 3 * mesh.faces.size()};
  std::vector<Scene> scenes;
  for (const Camera& camera : request.cameras) {
    scene.camera = Scaled(camera, static_cast<float>(request.size * kSamples) /
                                      static_cast<float>(request.camera_size));
    scenes.push_back(scene);
  }
  RenderOptions options;
  options.width = options.height = request.size * kSamples;
  Renderer renderer = RendererOn(workers);
  Frame frame;
  TILEGRAD_TRY(renderer.Render(scenes, options, {.alpha = false}, &frame));
  std::vector<ImageU8> out;
  for (std::size_t n = 0; n < scenes.size(); ++n)
    out.push_back(Resolve(frame.images(), n, request.size));
  return out;
}

ImageU8 CompositeOverPaper(std::span<const std::uint8_t> planar, int size) {
  ImageU8 out(size, size, 3);
  const std::size_t plane = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  for (std::size_t p = 0; p < plane; ++p) {
    const float through = kPaper * (1 - static_cast<float>(planar[3 * plane + p]) / 255);
    for (std::size_t c = 0; c < 3; ++c)
      out.pixels[3 * p + c] = ToByte(static_cast<float>(planar[c * plane + p]) / 255 + through);
  }
  return out;
}

ImageU8 TileImages(std::span<const ImageU8> images, int columns) {
  if (images.empty()) return {};
  const int count = static_cast<int>(images.size()), across = std::min(columns, count),
            down = (count + columns - 1) / columns;
  const int width = images[0].width, height = images[0].height;
  ImageU8 out(across * (width + kGap) - kGap, down * (height + kGap) - kGap, 3, 255);
  for (int i = 0; i < count; ++i) {
    const ImageU8& from = images[static_cast<std::size_t>(i)];
    for (int y = 0; y < height; ++y) {
      std::copy_n(from.at(0, y), 3 * width,
                  out.at(i % columns * (width + kGap), i / columns * (height + kGap) + y));
    }
  }
  return out;
}

}  // namespace tilegrad::train
