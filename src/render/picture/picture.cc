// SPDX-License-Identifier: Apache-2.0
#include "render/picture/picture.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "raster/conventions.h"
#include "scene/camera_conventions.h"

namespace tilegrad {
namespace {

std::size_t PixelCount(const PictureRequest& r) {
  return static_cast<std::size_t>(r.width) * static_cast<std::size_t>(r.height);
}

Status Check(const PictureRequest& r) {
  if (r.width < 1 || r.height < 1 || r.supersampling < 1)
    return InvalidArgument("an image of {} x {} pixels, {} samples along each side", r.width,
                           r.height, r.supersampling);
  if (std::max(r.width, r.height) > raster::kMaxImageSize / r.supersampling) {
    return InvalidArgument(
        "{} x {} pixels with {} samples along each side is more than {}; take fewer of either",
        r.width, r.height, r.supersampling, raster::kMaxImageSize);
  }
  return {};
}

RenderOptions OptionsOf(const PictureRequest& r, int scale) {
  RenderOptions options;
  options.width = scale * r.width;
  options.height = scale * r.height;
  options.culling = r.culling;
  if (r.soft_delta > 0) options.delta = r.soft_delta;
  return options;
}

bool Layered(const PictureRequest& r) { return r.cover != nullptr && r.soft_delta <= 0; }

// Sums over the samples of one pixel.
struct Square {
  float rgb[3] = {}, covered = 0, alpha = 0;
};

Square SumSamples(const Images& frame, int x, int y, int scale) {
  Square sum;
  const auto pixels =
      static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
  for (int j = y * scale; j < (y + 1) * scale; ++j) {
    for (int i = x * scale; i < (x + 1) * scale; ++i) {
      const auto at = static_cast<std::size_t>(j) * static_cast<std::size_t>(frame.width) +
                      static_cast<std::size_t>(i);
      if (!frame.alpha.empty()) sum.alpha += frame.alpha[at];
      if (frame.face_ids[at] < 0) continue;
      sum.covered += 1;
      for (std::size_t c = 0; c < 3 && !frame.color.empty(); ++c)
        sum.rgb[c] += std::clamp(frame.color[c * pixels + at], 0.0f, 1.0f);
    }
  }
  return sum;
}

template <class To, class From>
void Copy(const From& from, To* to) {
  to->assign(from.begin(), from.end());
}

}  // namespace

void AverageSamples(const Images& samples, int scale, Picture* picture) {
  picture->width = samples.width / scale;
  picture->height = samples.height / scale;
  const auto pixels =
      static_cast<std::size_t>(picture->width) * static_cast<std::size_t>(picture->height);
  const auto count = static_cast<float>(scale * scale);
  picture->color.assign(samples.color.empty() ? 0 : 3 * pixels, 0);
  picture->alpha.assign(pixels, 0);
  for (std::size_t at = 0; at < pixels; ++at) {
    const int x = static_cast<int>(at) % picture->width, y = static_cast<int>(at) / picture->width;
    const Square sum = SumSamples(samples, x, y, scale);
    picture->alpha[at] = (samples.alpha.empty() ? sum.covered : sum.alpha) / count;
    for (std::size_t c = 0; c < 3 && !samples.color.empty() && sum.covered > 0; ++c)
      picture->color[c * pixels + at] = sum.rgb[c] / sum.covered;
  }
}

// Averages the layers' sums over squares, like AverageSamples.
void PictureRenderer::AverageLayers(const PictureRequest& request, Picture* picture) const {
  const auto scale = static_cast<std::size_t>(request.supersampling);
  const auto width = static_cast<std::size_t>(request.width);
  const std::size_t pixels = PixelCount(request), samples = through_.size();
  picture->color.assign(request.color ? 3 * pixels : 0, 0);
  picture->alpha.assign(pixels, 0);
  for (std::size_t at = 0; at < pixels; ++at) {
    const std::size_t x = at % width * scale, y = at / width * scale;
    float rgb[3] = {}, covered = 0;
    for (std::size_t k = 0; k < scale * scale; ++k) {
      const std::size_t sample = (y + k / scale) * width * scale + x + k % scale;
      covered += 1 - through_[sample];
      for (std::size_t c = 0; c < 3 && request.color; ++c) rgb[c] += seen_[c * samples + sample];
    }
    picture->alpha[at] = covered / static_cast<float>(scale * scale);
    for (std::size_t c = 0; c < 3 && request.color && covered > 0; ++c)
      picture->color[c * pixels + at] = rgb[c] / covered;
  }
}

Status PictureRenderer::RenderColorLayers(const Scene& scene, const PictureRequest& request,
                                          Picture* picture) {
  constexpr float kUnseen = 1.0f / 1024;  // below a step of 8 bits
  const RenderOptions options = OptionsOf(request, request.supersampling);
  const auto samples =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  seen_.assign(request.color ? 3 * samples : 0, 0);
  through_.assign(samples, 1);
  Outputs images;
  images.color = request.color;
  images.attributes = images.alpha = false;
  const auto take = [&](const Images& layer, std::size_t at, float cover) {
    float& through = through_[at];
    for (std::size_t c = 0; c < 3 && request.color; ++c) {
      const std::size_t i = c * samples + at;
      seen_[i] += through * cover * std::clamp(layer.color[i], 0.0f, 1.0f);
    }
    through *= 1 - cover;
    if (through < kUnseen) through = 0;
    return through == 0;
  };
  TILEGRAD_TRY(layers_.Render(scene, *request.cover, options, images, take));
  AverageLayers(request, picture);
  return {};
}

Status PictureRenderer::RenderColor(Scene scene, const PictureRequest& request, Picture* picture) {
  const int scale = request.supersampling;
  scene.camera = ScaledCamera(scene.camera, static_cast<float>(scale));
  if (Layered(request)) return RenderColorLayers(scene, request, picture);
  Outputs images;
  images.color = request.color;
  images.attributes = false;
  images.alpha = request.soft_delta > 0;
  TILEGRAD_TRY(renderer_.Render({&scene, 1}, OptionsOf(request, scale), images, &frame_));
  AverageSamples(frame_.images(), scale, picture);
  return {};
}

Status PictureRenderer::RenderExactLayers(const Scene& scene, const PictureRequest& request,
                                          const Outputs& images, Picture* picture) {
  const std::size_t pixels = PixelCount(request);
  constexpr float kFar = std::numeric_limits<float>::infinity();
  picture->depth.assign(request.depth ? pixels : 0, kFar);
  picture->normals.assign(request.normals ? 3 * pixels : 0, 0);
  picture->uv.assign(request.uv ? 2 * pixels : 0, 0);
  picture->face_ids.assign(request.face_ids ? pixels : 0, -1);
  const auto take = [&](const Images& layer, std::size_t at, float cover) {
    if (cover <= 0) return false;
    if (request.depth) picture->depth[at] = layer.depth[at];
    if (request.face_ids) picture->face_ids[at] = layer.face_ids[at];
    for (std::size_t i = at; i < picture->normals.size(); i += pixels)
      picture->normals[i] = layer.normals[i];
    for (std::size_t i = at; i < layer.uv.size(); i += pixels) picture->uv[i] = layer.uv[i];
    return true;
  };
  return layers_.Render(scene, *request.cover, OptionsOf(request, 1), images, take);
}

Status PictureRenderer::RenderExact(const Scene& scene, const PictureRequest& request,
                                    Picture* picture) {
  Outputs images;
  images.color = images.attributes = images.alpha = false;
  images.depth = request.depth;
  images.normals = request.normals;
  images.uv = request.uv && !scene.uvs.values.empty();
  if (Layered(request)) return RenderExactLayers(scene, request, images, picture);
  TILEGRAD_TRY(renderer_.Render({&scene, 1}, OptionsOf(request, 1), images, &frame_));
  if (request.depth) Copy(frame_.images().depth, &picture->depth);
  if (request.normals) Copy(frame_.images().normals, &picture->normals);
  if (request.uv) Copy(frame_.images().uv, &picture->uv);
  if (request.uv && !images.uv) picture->uv.assign(2 * PixelCount(request), 0);
  if (request.face_ids) Copy(frame_.images().face_ids, &picture->face_ids);
  return {};
}

Status PictureRenderer::Render(const Scene& scene, const PictureRequest& request,
                               Picture* picture) {
  TILEGRAD_TRY(Check(request));
  *picture = Picture{};
  picture->width = request.width;
  picture->height = request.height;
  if (request.color || request.alpha) {
    TILEGRAD_TRY(RenderColor(scene, request, picture));
    picture->plans.push_back(Layered(request) ? layers_.plan() : Explain(renderer_));
  }
  if (request.depth || request.normals || request.uv || request.face_ids) {
    TILEGRAD_TRY(RenderExact(scene, request, picture));
    picture->plans.push_back(Layered(request) ? layers_.plan() : Explain(renderer_));
  }
  return {};
}

}  // namespace tilegrad
