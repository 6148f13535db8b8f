// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/photo_store.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/try_all.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kCropStream = 0x63726f70;

// Around the unmoved window there is room for this much jitter, relative to its side.
constexpr double kMargin = CropRule::kMostJitter;

// Area averaging: samples so dense that each pixel of the photograph is met.
class Averager {
 public:
  Averager(const ImageU8& image, const Photograph& photo) : image_(image), photo_(photo) {}

  // Mean of the square of `side` photograph pixels at (left, top): RGB and mask, 0 to 255.
  std::array<double, 4> Mean(double left, double top, double side) const {
    const int samples = std::max(1, static_cast<int>(std::ceil(side)));
    std::array<double, 4> sum{};
    for (int j = 0; j < samples; ++j) {
      for (int i = 0; i < samples; ++i)
        Add(left + (i + 0.5) * side / samples, top + (j + 0.5) * side / samples, &sum);
    }
    for (double& s : sum) s /= static_cast<double>(samples) * samples;
    return sum;
  }

 private:
  // Bilinear between pixel centres; white beyond the edges.
  void Add(double x, double y, std::array<double, 4>* sum) const {
    const double u = std::floor(x - 0.5), v = std::floor(y - 0.5);
    const double fx = x - 0.5 - u, fy = y - 0.5 - v;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const double weight = (dx ? fx : 1 - fx) * (dy ? fy : 1 - fy);
        AddPixel(static_cast<int>(u) + dx, static_cast<int>(v) + dy, weight, sum);
      }
    }
  }
  void AddPixel(int x, int y, double weight, std::array<double, 4>* sum) const {
    const bool there = x >= 0 && y >= 0 && x < image_.width && y < image_.height;
    for (std::size_t c = 0; c < 3; ++c) (*sum)[c] += weight * (there ? image_.at(x, y)[c] : 255);
    (*sum)[3] += weight * (photo_.mask.at(x, y) ? 255 : 0);
  }

  const ImageU8& image_;
  const Photograph& photo_;
};

PhotoWindow Grown(const PhotoWindow& window, double side) {
  const double more = (side - window.side) / 2;
  return {window.left - more, window.top - more, side};
}

}  // namespace

PhotoWindow WindowOf(const PhotoBox& box, const CropRule& rule, Rng* rng) {
  const double width = box.right - box.left, height = box.bottom - box.top;
  double moves[4] = {};
  if (rng != nullptr) {
    for (double& move : moves) move = rule.jitter * (1 - 2 * rng->Uniform());
  }
  const double left = box.left - (rule.padding + moves[0]) * width,
               right = box.right + (rule.padding + moves[2]) * width,
               top = box.top - (rule.padding + moves[1]) * height,
               bottom = box.bottom + (rule.padding + moves[3]) * height;
  const double side = std::max(right - left, bottom - top);
  return {(left + right - side) / 2, (top + bottom - side) / 2, side};
}

Result<PhotoStore> PhotoStore::Load(const PhotographSet& set, const std::vector<int>& photographs,
                                    const CropRule& rule, int size, const Workers& workers,
                                    const Watch& watch) {
  PhotoStore store;
  store.rule_ = rule;
  store.mirror_ = set.mirror;
  store.size_ = size;
  store.stored_ = size + 2 * static_cast<int>(std::ceil(kMargin * size));
  for (const int i : photographs)
    store.photos_.push_back(&set.photographs[static_cast<std::size_t>(i)]);
  store.windows_.resize(photographs.size());
  store.bytes_.Resize(photographs.size() * store.stored_bytes());
  const Status read = TryAll(workers, photographs.size(), {"reading photographs", watch},
                             [&](std::size_t i, std::size_t) { return store.LoadOne(i, watch); });
  if (read.ok()) return store;
  const bool published = set.source == "cub" || set.source == "pascal3d";
  if (!published || watch.stopped()) return read;
  return Status(read.code(),
                fmt::format("{}; tilegrad dataset --source {} leaves out what is broken",
                            read.message(), set.source));
}

Status PhotoStore::LoadOne(std::size_t i, const Watch& watch) {
  const Photograph& photo = *photos_[i];
  // Masks and boxes count pixels as the file stores them.
  TILEGRAD_ASSIGN(io::StoredImage read, io::LoadStoredImage(photo.image));
  const ImageU8 image = io::ToColor(std::move(read.image));
  if (image.width != photo.mask.width || image.height != photo.mask.height)
    return InvalidArgument("{}: {} x {} pixels, but its mask has {} x {}", photo.image.string(),
                           image.width, image.height, photo.mask.width, photo.mask.height);
  const PhotoWindow inner = WindowOf(photo.box, rule_, nullptr);
  windows_[i] = Grown(inner, inner.side * stored_ / size_);
  const Averager averager(image, photo);
  const double step = windows_[i].side / stored_;
  std::uint8_t* const out = &bytes_[i * stored_bytes()];
  const std::size_t plane = stored_bytes() / 4;
  for (int y = 0; y < stored_ && !watch.stopped(); ++y) {
    for (int x = 0; x < stored_; ++x) {
      const auto mean =
          averager.Mean(windows_[i].left + x * step, windows_[i].top + y * step, step);
      for (std::size_t c = 0; c < 4; ++c)
        out[c * plane + static_cast<std::size_t>(y * stored_ + x)] =
            static_cast<std::uint8_t>(mean[c] + 0.5);
    }
  }
  return {};
}

// Bilinear within the stored crop, whose edge is extended beyond it.
void PhotoStore::Resample(int i, const PhotoWindow& window, bool mirrored, std::span<float> rgb,
                          std::span<float> mask) const {
  const PhotoWindow& whole = windows_[static_cast<std::size_t>(i)];
  const double to_stored = stored_ / whole.side, step = window.side / size_ * to_stored;
  const double left = (window.left - whole.left) * to_stored - 0.5,
               top = (window.top - whole.top) * to_stored - 0.5;
  const std::size_t plane = stored_bytes() / 4;
  const std::uint8_t* const bytes = &bytes_[static_cast<std::size_t>(i) * stored_bytes()];
  const auto place = [&](double at) {
    const double cut = std::clamp(at, 0.0, stored_ - 1.0);
    const int low = std::min(static_cast<int>(cut), stored_ - 2);
    return std::pair(low, static_cast<float>(cut - low));
  };
  for (int y = 0; y < size_; ++y) {
    const auto [v, fy] = place(top + (y + 0.5) * step);
    for (int x = 0; x < size_; ++x) {
      const auto [u, fx] = place(left + ((mirrored ? size_ - 1 - x : x) + 0.5) * step);
      const std::uint8_t* at = bytes + static_cast<std::size_t>(v * stored_ + u);
      const auto to = static_cast<std::size_t>(y * size_ + x);
      for (std::size_t c = 0; c < 4; ++c, at += plane) {
        const float upper = (1 - fx) * at[0] + fx * at[1];
        const float lower = (1 - fx) * at[stored_] + fx * at[stored_ + 1];
        const float value = ((1 - fy) * upper + fy * lower) / 255;
        (c < 3 ? rgb[c * static_cast<std::size_t>(size_ * size_) + to] : mask[to]) = value;
      }
    }
  }
}

CroppedPhoto PhotoStore::Cut(int i, const CropDraw& draw, std::span<float> rgb,
                             std::span<float> mask) const {
  const Photograph& photo = photograph(i);
  Rng rng(draw.seed ^ kCropStream, draw.position);
  const PhotoWindow window = WindowOf(photo.box, rule_, draw.random ? &rng : nullptr);
  const bool mirrored = draw.random && rng.Uniform() < draw.mirrored;
  Resample(i, window, mirrored, rgb, mask);
  CroppedPhoto out;
  out.to_box = window.side / (2 * photo.box.longer_side());
  const auto across = [&](double at, double low) { return 2 * (at - low) / window.side - 1; };
  for (std::size_t k = 0; k < photo.keypoints.size(); ++k) {
    const std::size_t from = mirrored ? static_cast<std::size_t>(mirror_[k]) : k;
    Keypoint keypoint = photo.keypoints[from];
    keypoint.x = keypoint.visible ? across(keypoint.x, window.left) * (mirrored ? -1 : 1) : 0;
    keypoint.y = keypoint.visible ? across(keypoint.y, window.top) : 0;
    out.keypoints.push_back(keypoint);
  }
  if (!photo.camera) return out;
  out.camera = CroppedCamera(*photo.camera, window.left, window.top, 2 / window.side);
  for (double& t : out.camera.translation) t -= 1;
  if (mirrored) out.camera = MirroredCamera(out.camera, 0);
  return out;
}

}  // namespace tilegrad::train
