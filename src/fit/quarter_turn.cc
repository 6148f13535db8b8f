// SPDX-License-Identifier: Apache-2.0
#include "fit/quarter_turn.h"

#include <algorithm>
#include <utility>

#include "io/image_file.h"

namespace tilegrad::train {
namespace {

// Of an image of `width` pixels: three more quarter turns, whose heights cancel.
Camera TurnedBack(const Camera& camera, int width) {
  return TurnedCamera(TurnedCamera(TurnedCamera(camera, 0), width), 0);
}

}  // namespace

bool IsTurned(const FitInput& input, std::size_t view) {
  return std::ranges::binary_search(input.turned, static_cast<int>(view));
}

std::vector<float> TurnedPlanes(std::span<const float> planes, ImageSize size) {
  const auto width = static_cast<std::size_t>(size.width);
  const auto height = static_cast<std::size_t>(size.height);
  std::vector<float> out(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const std::size_t row = i / width % height, plane = i / width / height;
    out[(plane * width + i % width) * height + height - 1 - row] = planes[i];
  }
  return out;
}

Camera TurnedCamera(const Camera& camera, int height) {
  Camera out = camera;
  for (int c = 0; c < 3; ++c) {
    out.rotation[c] = camera.rotation[3 + c];
    out.rotation[3 + c] = -camera.rotation[c];
  }
  out.translation[0] = camera.translation[1];
  out.translation[1] = -camera.translation[0];
  out.fx = camera.fy;
  out.fy = camera.fx;
  out.cx = static_cast<float>(height) - camera.cy;
  out.cy = camera.cx;
  return out;
}

std::vector<Camera> HeldCameras(const FitInput& input, std::span<const Camera> cameras) {
  std::vector<Camera> out(cameras.begin(), cameras.end());
  for (const int view : input.turned) {
    Camera& camera = out[static_cast<std::size_t>(view)];
    camera = TurnedBack(camera, input.images.width);
  }
  return out;
}

ImageU8 HeldImage(const FitInput& input, std::size_t view, ImageU8 image) {
  constexpr int kCounterclockwise = 8;  // as Exif has it
  return IsTurned(input, view) ? io::Upright(std::move(image), kCounterclockwise) : image;
}

}  // namespace tilegrad::train
