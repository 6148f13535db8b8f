// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/pictures.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "render/picture/composite.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/stream/textured_meshes.h"
#include "train/ops/weak_cameras.h"

namespace tilegrad::train {
namespace {

constexpr int kPixelSamples = 3, kPictureZoom = 4;
constexpr std::uint8_t kSeen[3] = {255, 60, 30}, kPredicted[3] = {40, 200, 255};

// Looks at the object from the side (azimuth 90), or obliquely from in front.
WeakPerspective LookAround(double azimuth, double scale) {
  const double half = azimuth * std::numbers::pi / 360, tilt = 0.96 * std::numbers::pi / 2;
  const double c = std::cos(half), s = std::sin(half);
  const double w = std::cos(tilt), x = std::sin(tilt);
  return {scale, {0, 0}, {w * c, x * c, w * s, x * s}};
}

void Dot(double x, double y, const std::uint8_t (&color)[3], bool ring, ImageU8* image) {
  const double u = (x + 1) / 2 * image->width, v = (y + 1) / 2 * image->height;
  const double radius = image->width / 40.0;
  for (int j = 0; j < image->height; ++j) {
    for (int i = 0; i < image->width; ++i) {
      const double d = std::hypot(i + 0.5 - u, j + 0.5 - v);
      if (ring ? std::abs(d - radius) < radius / 3 : d < radius / 2)
        std::copy_n(color, 3, image->at(i, j));
    }
  }
}

ImageU8 PhotoImage(std::span<const float> rgb, int size) {
  ImageU8 out(size, size, 3);
  const std::size_t plane = rgb.size() / 3;
  for (std::size_t i = 0; i < rgb.size(); ++i) out.pixels[i] = ToByte(rgb[i % 3 * plane + i / 3]);
  return out;
}

}  // namespace

PhotographPictures::PhotographPictures(int size)
    : size_(size), pictures_(NoLight(), size, kPixelSamples) {}

Result<std::vector<float>> PhotographPictures::Draw(const Mesh& mesh,
                                                    const WeakPerspective& camera) {
  return pictures_.Draw(mesh, {PinholeIn(camera, size_), {}}, Appearance::kTexture);
}

Result<std::vector<ShownPicture>> PhotographPictures::Row(const std::string& name,
                                                          const PredictedPhotograph& predicted,
                                                          const CroppedPhoto& crop,
                                                          std::span<const float> rgb) {
  std::vector<ShownPicture> out;
  const auto add = [&](const std::string& caption, ImageU8 image) {
    out.push_back({std::move(image), caption, name + ": " + caption});
  };
  const ImageU8 photo = PhotoImage(rgb, size_);
  add("photograph", photo);
  if (!predicted.keypoints.empty()) {
    ImageU8 marked = Enlarged(photo, kPictureZoom);
    for (std::size_t k = 0; k < crop.keypoints.size(); ++k) {
      if (!crop.keypoints[k].visible) continue;
      const auto seen = ProjectWeakly(crop.camera, predicted.keypoints[k]);
      Dot(crop.keypoints[k].x, crop.keypoints[k].y, kSeen, false, &marked);
      Dot(seen[0], seen[1], kPredicted, true, &marked);
    }
    add("keypoints", std::move(marked));
  }
  TILEGRAD_ASSIGN(const auto drawn, Draw(predicted.mesh, crop.camera));
  add("prediction", OnPaper(drawn, size_));
  for (const auto& [caption, azimuth] :
       {std::pair("side", 90.0), {"front", 30.0}, {"other side", 240.0}}) {
    TILEGRAD_ASSIGN(const auto around, Draw(predicted.mesh, LookAround(azimuth, 0.8)));
    add(caption, OnPaper(around, size_));
  }
  add("texture", predicted.mesh.textures[0].image);
  return out;
}

}  // namespace tilegrad::train
