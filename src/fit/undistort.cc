// SPDX-License-Identifier: Apache-2.0
#include "fit/undistort.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image_file.h"
#include "train/data/cutout.h"

namespace tilegrad::train {
namespace {

constexpr float kOutlineAlpha = 0.5f;  // alpha at the object's outline
constexpr double kLeastScale = 0.25;   // of the focal length: an object at a fisheye's rim is cut

// Four pixels and their weights.
struct Taps {
  std::array<std::size_t, 4> pixels;
  std::array<float, 4> weights;
};

class Undistortion {
 public:
  Undistortion(const LensDistortion& lens, const Camera& camera, const ViewPixels& from)
      : lens_(lens),
        largest_(LargestRadius(lens)),
        camera_(CameraCast<double>(camera)),
        from_(from),
        masked_(std::ranges::any_of(from.alpha, [](float a) { return a < 1; })) {}

  // By which the focal length is to shrink, so that all of the object stays in the image.
  double Scale() const {
    double scale = 1;
    if (!masked_) return scale;
    const auto width = from_.size.width, height = from_.size.height;
    for (int y = 0; y < height; ++y) AddRun({0, y}, {1, 0}, width, &scale);
    for (int x = 0; x < width; ++x) AddRun({x, 0}, {0, 1}, height, &scale);
    return std::max(scale, kLeastScale);
  }

  void Fill(double scale, ViewPixels* out) const {
    for (int y = 0; y < from_.size.height; ++y) {
      for (int x = 0; x < from_.size.width; ++x) {
        const Vec2Array at = PlaceOf({x, y});
        FillPixel({at[0] / scale, at[1] / scale}, IndexOf({x, y}), out);
      }
    }
  }

 private:
  struct Pixel {
    int x = 0, y = 0;
  };

  std::size_t IndexOf(Pixel p) const {
    return static_cast<std::size_t>(p.y) * static_cast<std::size_t>(from_.size.width) +
           static_cast<std::size_t>(p.x);
  }
  // Its centre, as lens_distortion.h counts.
  Vec2Array PlaceOf(Pixel p) const {
    return {(p.x + 0.5 - camera_.cx) / camera_.fx, (p.y + 0.5 - camera_.cy) / camera_.fy};
  }

  // The outermost pixels of the object on a row or a column.
  void AddRun(Pixel from, Pixel step, int count, double* scale) const {
    int first = count, last = -1;
    for (int i = 0; i < count; ++i) {
      const Pixel p = {from.x + i * step.x, from.y + i * step.y};
      if (from_.alpha[IndexOf(p)] < kOutlineAlpha) continue;
      first = std::min(first, i);
      last = i;
    }
    if (last < 0) return;
    for (const int i : {first, last}) AddOutline({from.x + i * step.x, from.y + i * step.y}, scale);
  }

  void AddOutline(Pixel p, double* scale) const {
    const auto place = Unbent(lens_, PlaceOf(p), largest_);
    if (!place) return;
    const auto keep = [&](double offset, double centre, int side) {
      const double room = offset > 0 ? side - centre : centre;
      if (room > 0 && std::abs(offset) > room) *scale = std::min(*scale, room / std::abs(offset));
    };
    keep(camera_.fx * (*place)[0], camera_.cx, from_.size.width);
    keep(camera_.fy * (*place)[1], camera_.cy, from_.size.height);
  }

  void FillPixel(Vec2Array place, std::size_t to, ViewPixels* out) const {
    const double radius = std::hypot(place[0], place[1]);
    const bool seen = radius <= largest_;
    if (!seen) place = {place[0] * largest_ / radius, place[1] * largest_ / radius};
    const Vec2Array bent = Bent(lens_, place);
    const double x = camera_.cx + camera_.fx * bent[0], y = camera_.cy + camera_.fy * bent[1];
    const bool inside = seen && x >= 0 && y >= 0 && x <= from_.size.width && y <= from_.size.height;
    const Taps taps = TapsAt(x - 0.5, y - 0.5);
    float alpha = 0;
    for (std::size_t k = 0; k < 4; ++k) alpha += taps.weights[k] * from_.alpha[taps.pixels[k]];
    for (std::size_t c = 0; c < 3; ++c) {
      const float* plane = &from_.color[c * from_.pixels()];
      float sum = 0;  // what is transparent has no say, unless all is
      for (std::size_t k = 0; k < 4; ++k) {
        const float share = alpha > 0 ? from_.alpha[taps.pixels[k]] / alpha : 1.0f;
        sum += taps.weights[k] * share * plane[taps.pixels[k]];
      }
      out->color[c * out->pixels() + to] = std::clamp(sum, 0.0f, 1.0f);
    }
    // Without a mask exactly 1, which sums of weights are not.
    out->alpha[to] = !masked_ ? 1.0f : inside ? std::clamp(alpha, 0.0f, 1.0f) : 0.0f;
  }

  // Bilinear; beyond the border its pixels.
  Taps TapsAt(double x, double y) const {
    const int last_x = from_.size.width - 1, last_y = from_.size.height - 1;
    x = std::clamp(std::isfinite(x) ? x : 0.0, 0.0, static_cast<double>(last_x));
    y = std::clamp(std::isfinite(y) ? y : 0.0, 0.0, static_cast<double>(last_y));
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const auto right = static_cast<float>(x - x0), down = static_cast<float>(y - y0);
    const int x1 = std::min(x0 + 1, last_x), y1 = std::min(y0 + 1, last_y);
    return {{IndexOf({x0, y0}), IndexOf({x1, y0}), IndexOf({x0, y1}), IndexOf({x1, y1})},
            {(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down}};
  }

  const LensDistortion& lens_;
  const double largest_;
  const Camera64 camera_;
  const ViewPixels& from_;
  const bool masked_;
};

}  // namespace

Camera Undistort(const LensDistortion& lens, const Camera& camera, ViewPixels* view) {
  if (lens.straight()) return camera;
  const ViewPixels from = *view;
  const Undistortion undistortion(lens, camera, from);
  const double scale = undistortion.Scale();
  undistortion.Fill(scale, view);
  Camera out = camera;
  out.fx *= static_cast<float>(scale);
  out.fy *= static_cast<float>(scale);
  return out;
}

namespace {

// NeRF programs differ: some turn images first, some ignore the tag as COLMAP does. Where the
// camera's size is that of the stored image and not of the upright one, it counts stored pixels.
Result<ImageU8> LoadTarget(const InputFrame& frame) {
  TILEGRAD_ASSIGN(io::StoredImage stored, io::LoadStoredImage(frame.image));
  if (frame.stored_order) return std::move(stored.image);
  const ImageSize meant = frame.camera.size.value_or(ImageSize());
  const auto fits = [&](const ImageU8& image) {
    return std::int64_t{image.width} * meant.height == std::int64_t{image.height} * meant.width;
  };
  const bool fits_stored = meant.width > 0 && fits(stored.image);
  ImageU8 upright = io::Upright(stored.image, stored.orientation);
  return fits_stored && !fits(upright) ? std::move(stored.image) : std::move(upright);
}

void TakeImage(const ImageU8& image, ViewPixels* out) {
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t plane = image.pixels.size() / channels;
  const bool has_alpha = channels == 2 || channels == 4;
  out->size = {image.width, image.height};
  out->color.resize(3 * plane);
  out->alpha.resize(plane);
  for (std::size_t p = 0; p < plane; ++p) {
    const std::uint8_t* pixel = &image.pixels[channels * p];
    for (std::size_t c = 0; c < 3; ++c) {
      out->color[c * plane + p] = static_cast<float>(pixel[channels >= 3 ? c : 0]) / 255;
    }
    out->alpha[p] = has_alpha ? static_cast<float>(pixel[channels - 1]) / 255 : 1.0f;
  }
  if (has_alpha) out->mask = "its alpha channel";
}

// Means over squares of `factor` pixels.
void ReduceMask(const ImageU8& mask, int factor, ImageSize size, std::span<float> alpha) {
  const std::vector<std::uint8_t> values = MaskValues(mask);
  const auto squares = static_cast<std::int64_t>(factor) * factor;
  std::size_t to = 0;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      std::int64_t sum = 0;
      for (std::int64_t s = 0; s < squares; ++s) {
        const std::int64_t column = x * factor + s % factor, row = y * factor + s / factor;
        sum += values[static_cast<std::size_t>(row * mask.width + column)];
      }
      alpha[to++] = static_cast<float>(sum) / static_cast<float>(255 * squares);
    }
  }
}

}  // namespace

Status LoadMask(const Path& path, ImageSize size, std::span<float> alpha) {
  TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(path));
  const int factor = std::max(1, mask.width / size.width);
  if (mask.width / factor != size.width || mask.height / factor != size.height) {
    return DataLoss("{}: the mask has {} x {} pixels, its image {} x {}; save it at that size",
                    path.string(), mask.width, mask.height, size.width, size.height);
  }
  ReduceMask(mask, factor, size, alpha);
  return {};
}

Result<ViewPixels> LoadViewPixels(const InputFrame& frame) {
  TILEGRAD_ASSIGN(const ImageU8 image, LoadTarget(frame));
  ViewPixels out;
  TakeImage(image, &out);
  if (frame.mask.empty()) return out;
  TILEGRAD_TRY(LoadMask(frame.mask, out.size, out.alpha));
  out.mask = frame.mask.string();
  return out;
}

}  // namespace tilegrad::train
