// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/rendered_views.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image_file.h"
#include "scene/camera_conventions.h"
#include "train/data/cutout.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::train {
namespace {

// 255 inside.
ImageU8 HardMask(const ImageU8& mask) {
  ImageU8 out(mask.width, mask.height, 1);
  for (std::size_t p = 0; p < out.pixels.size(); ++p)
    out.pixels[p] = mask.pixels[p * static_cast<std::size_t>(mask.channels)] != 0 ? 255 : 0;
  return out;
}

Result<std::vector<std::uint8_t>> LoadRenderedView(const RenderedView& view, int size) {
  TILEGRAD_ASSIGN(ImageU8 image, io::LoadImage(view.image));
  if (!view.mask.empty()) {
    TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(view.mask));
    TILEGRAD_ASSIGN(image, WithMask(image, HardMask(mask)));
  }
  if (image.width != image.height || image.width < size)
    return InvalidArgument("{} x {} pixels, not a square of --size {} or more", image.width,
                           image.height, size);
  return PrepareCutout(image, size, Framing::kKeep);
}

// What is in a picture, by the outermost points.
struct PictureBox {
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};  // x, y

  void Add(double x, double y) {
    low[0] = std::min(low[0], x);
    low[1] = std::min(low[1], y);
    high[0] = std::max(high[0], x);
    high[1] = std::max(high[1], y);
  }
  bool IsNear(const PictureBox& other, double pixels) const {
    for (int k = 0; k < 2; ++k) {
      if (!(std::abs(low[k] - other.low[k]) <= pixels)) return false;
      if (!(std::abs(high[k] - other.high[k]) <= pixels)) return false;
    }
    return true;
  }
};

PictureBox BoxOfMask(std::span<const std::uint8_t> alpha, int size) {
  PictureBox box;
  for (std::size_t p = 0; p < alpha.size(); ++p) {
    const int pixel = static_cast<int>(p);
    if (alpha[p] >= 128) box.Add(pixel % size + 0.5, pixel / size + 0.5);
  }
  return box;
}

PictureBox BoxOfVoxels(std::span<const std::uint8_t> occupancy, const Camera& camera,
                       double voxel) {
  PictureBox box;
  constexpr int n = kOccupancyResolution;
  for (std::size_t i = 0; i < occupancy.size(); ++i) {
    if (occupancy[i] == 0) continue;
    const int at = static_cast<int>(i), index[3] = {at / (n * n), at / n % n, at % n};
    double p[3];
    for (int r = 0; r < 3; ++r) {
      p[r] = camera.translation[r];
      for (int k = 0; k < 3; ++k)
        p[r] += camera.rotation[3 * r + k] * voxel * (index[k] + 0.5 - 0.5 * n);
    }
    box.Add(camera.cx + camera.fx * p[0] / -p[2], camera.cy - camera.fy * p[1] / -p[2]);
  }
  return box;
}

// Voxels, camera and picture are of one object: outlines in the first view differ by three voxels
// at most. Otherwise the set's numbers mean something else than we think.
Status CheckTogether(const ModelData& data, double half_extent, int size) {
  constexpr double kVoxelsApart = 3;
  const auto pixels = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  const Camera& camera = data.cameras[0];
  const double voxel = 2 * half_extent / kOccupancyResolution;
  const double per_voxel = camera.fx * voxel / -camera.translation[2];
  const PictureBox mask = BoxOfMask(std::span(data.images).subspan(3 * pixels, pixels), size),
                   voxels = BoxOfVoxels(data.occupancy, camera, voxel);
  if (mask.IsNear(voxels, kVoxelsApart * per_voxel)) return {};
  return DataLoss(
      "the voxels are elsewhere than the first picture shows, or of another size: columns {:.0f} "
      "to {:.0f} and rows {:.0f} to {:.0f} of {}, the picture has {:.0f} to {:.0f} and {:.0f} to "
      "{:.0f}",
      voxels.low[0], voxels.high[0], voxels.low[1], voxels.high[1], size, mask.low[0], mask.high[0],
      mask.low[1], mask.high[1]);
}

class RenderedViews : public ModelSource {
 public:
  RenderedViews(RenderedSet set, int image_size)
      : ModelSource({.name = set.name, .credits = {set.credit}, .published = true}),
        set_(std::move(set)),
        image_size_(image_size) {}

  Status List(const SplitList& list) {
    TILEGRAD_ASSIGN(const auto synsets, ListFolder(set_.models));
    for (const Path& synset : synsets) {
      if (IsFolder(synset)) TILEGRAD_TRY(ListClass(synset, list));
    }
    if (entries_.empty())
      return NotFound("{}: no models{}; expected {}", set_.models.string(),
                      list.empty() ? "" : " that the list names", set_.expected);
    if (entries_.size() < list.size())
      ignored_.push_back(
          {set_.models.string(), fmt::format("{} of {} models of the list are missing",
                                             list.size() - entries_.size(), list.size())});
    SortEntries(&entries_);
    return {};
  }

  std::optional<DatasetInfo> FixedInfo() const override {
    DatasetInfo info;
    info.image_size = image_size_;
    info.views = kRenderedViews;
    info.camera = set_.like;
    info.own_cameras = true;
    return info;
  }

  Result<SourceModel> Load(std::size_t entry) const override {
    TILEGRAD_ASSIGN(RenderedModel model, set_.read(FileOf(entry)));
    ModelData data = std::move(model.truth);
    for (const RenderedView& view : model.views) {
      const auto planes = LoadRenderedView(view, image_size_);
      if (!planes.ok()) return planes.status().Within(view.image.string());
      data.images.insert(data.images.end(), planes->begin(), planes->end());
      TILEGRAD_TRY(Validate(view.camera).Within(view.image.string()));
      data.cameras.push_back(
          ScaledCamera(CameraCast<float>(view.camera), static_cast<float>(image_size_)));
    }
    TILEGRAD_TRY(CheckTogether(data, set_.like.half_extent, image_size_).Within(FileOf(entry)));
    return SourceModel{std::move(data)};
  }

 private:
  Status ListClass(const Path& synset, const SplitList& list) {
    const std::string id = synset.filename().string();
    TILEGRAD_ASSIGN(std::vector<Path> models, ListFolder(synset));
    std::erase_if(models, [](const Path& model) { return !IsFolder(model); });
    if (models.empty()) ignored_.push_back({synset.string(), "holds no model: no class"});
    const auto training =
        static_cast<std::size_t>(set_.train_portion * static_cast<double>(models.size()));
    for (std::size_t i = 0; i < models.size(); ++i) {
      const std::string model = models[i].filename().string();
      Listing listing = list.Of(id, model);
      if (!listing.used) continue;
      if (!listing.split && set_.train_portion > 0)
        listing.split = i < training ? Split::kTrain : Split::kTest;
      entries_.push_back({SafeFileName(SynsetName(id)), SafeFileName(model), model,
                          "ShapeNet terms of use", "", models[i].string(), listing.split});
    }
    return {};
  }

  const RenderedSet set_;
  const int image_size_;
};

}  // namespace

Result<std::unique_ptr<ModelSource>> OpenRenderedSet(RenderedSet set, const SplitList& list,
                                                     int image_size) {
  auto source = std::make_unique<RenderedViews>(std::move(set), image_size);
  TILEGRAD_TRY(source->List(list));
  return std::unique_ptr<ModelSource>(std::move(source));
}

Camera64 CameraOfObject(Camera64 camera, const double centre[3], double scale) {
  for (int row = 0; row < 3; ++row) {
    double& t = camera.translation[row];
    for (int k = 0; k < 3; ++k) t += camera.rotation[3 * row + k] * centre[k];
    t /= scale;
  }
  return camera;
}

}  // namespace tilegrad::train
