// SPDX-License-Identifier: Apache-2.0
#include "fit/input.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "base/error.h"
#include "base/file.h"
#include "base/read_budget.h"
#include "fit/bare_frames.h"
#include "fit/colmap_frames.h"
#include "io/camera_file.h"
#include "io/image_file.h"
#include "io/orientation.h"
#include "train/data/cutout.h"
#include "train/data/dataset.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kMostPixels = std::size_t{1} << 30;  // of all views together

ImageSize SizeOf(const ImageU8& image) { return {image.width, image.height}; }

std::string Describe(ImageSize size) { return fmt::format("{} x {}", size.width, size.height); }

// NeRF programs differ: some turn images first, some ignore the tag as COLMAP does. Where the
// camera's size is that of the stored image and not of the upright one, it counts stored pixels.
Result<ImageU8> LoadTarget(const TransformsFrame& frame) {
  const ReadBudget budget;
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(frame.image));
  TILEGRAD_ASSIGN(ImageU8 stored,
                  io::DecodeImage(bytes, frame.image.string(), io::PixelOrder::kStored));
  if (frame.stored_order) return stored;
  const ImageSize meant = frame.camera.size.value_or(ImageSize());
  const auto fits = [&](const ImageU8& image) {
    return std::int64_t{image.width} * meant.height == std::int64_t{image.height} * meant.width;
  };
  const bool fits_stored = meant.width > 0 && fits(stored);
  ImageU8 upright = io::Upright(stored, io::OrientationOf(bytes));
  return fits_stored && !fits(upright) ? std::move(stored) : std::move(upright);
}

Status TakeMask(const Path& path, ImageSize size, float* alpha) {
  TILEGRAD_ASSIGN(const ImageU8 mask, io::LoadImage(path));
  if (mask.width != size.width || mask.height != size.height) {
    return DataLoss("{}: the mask has {} pixels, its image {}", path.string(),
                    Describe(SizeOf(mask)), Describe(size));
  }
  const std::vector<std::uint8_t> values = MaskValues(mask);
  std::transform(values.begin(), values.end(), alpha,
                 [](std::uint8_t v) { return static_cast<float>(v) / 255; });
  return {};
}

void TakeImage(const ImageU8& image, float* color, float* alpha) {
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t plane = image.pixels.size() / channels;
  for (std::size_t p = 0; p < plane; ++p) {
    const std::uint8_t* pixel = &image.pixels[channels * p];
    for (std::size_t c = 0; c < 3; ++c) {
      color[c * plane + p] = static_cast<float>(pixel[channels >= 3 ? c : 0]) / 255;
    }
    const bool has_alpha = channels == 2 || channels == 4;
    alpha[p] = has_alpha ? static_cast<float>(pixel[channels - 1]) / 255 : 1.0f;
  }
}

// Grows the input by one view.
Status AddView(const TransformsFrame& frame, FitInput* input) {
  TILEGRAD_ASSIGN(const ImageU8 image, LoadTarget(frame));
  TargetImages& all = input->images;
  const ImageSize size = SizeOf(image);
  if (input->names.empty()) all.width = size.width, all.height = size.height;
  if (size.width != all.width || size.height != all.height) {
    return DataLoss("{}: has {} pixels, the images before it {}", frame.image.string(),
                    Describe(size), Describe({all.width, all.height}));
  }
  const std::size_t plane = all.pixels(), n = input->names.size();
  if ((n + 1) * plane > kMostPixels) {
    return ResourceExhausted("{}: all images together have more than {} pixels",
                             frame.image.string(), kMostPixels);
  }
  auto camera = CameraOfFrame(frame, size);
  if (!camera.ok()) return camera.status().Within("camera of " + frame.image.string());
  all.color.resize(3 * plane * (n + 1)), all.alpha.resize(plane * (n + 1));
  TakeImage(image, all.color.data() + 3 * plane * n, all.alpha.data() + plane * n);
  if (!frame.mask.empty()) {
    TILEGRAD_TRY(TakeMask(frame.mask, size, all.alpha.data() + plane * n));
  }
  input->cameras.push_back(*camera);
  input->names.push_back(frame.image.filename().string());
  return {};
}

Status AddViews(std::span<const TransformsFrame> frames, const Watch& watch, FitInput* input) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    TILEGRAD_TRY(watch.At({"reading images", i, frames.size(), ""}));
    TILEGRAD_TRY(AddView(frames[i], input));
  }
  return watch.At({"reading images", frames.size(), frames.size(), ""});
}

// Every n-th view, from the n-th on, is held out.
void HoldOut(int every, FitInput* input) {
  for (int i = 0; i < static_cast<int>(input->cameras.size()); ++i) {
    const bool held = every > 0 && i % every == every - 1;
    (held ? input->held_out : input->training).push_back(i);
  }
}

Status Finish(FitInput* input) {
  if (input->training.empty())
    return InvalidArgument("all views are held out: none is left to fit");
  input->masked = HasAlpha(*input);
  return {};
}

// Of transforms.json, or of a COLMAP model where there is none, or pictures without cameras.
// Says in `input` whether they have cameras, and warns.
Result<std::vector<TransformsFrame>> ReadFrames(const Path& folder, double fov, FitInput* input) {
  for (const char* name : {"transforms.json", "transforms_train.json"}) {
    if (PathExists(folder / name)) return ReadTransforms(folder / name);
  }
  if (const auto model = io::FindColmapModel(folder)) {
    if (!model->note.empty()) input->warnings.push_back(model->note);
    return ReadColmapFrames(model->folder);
  }
  TILEGRAD_ASSIGN(auto bare, ReadBareFrames(folder, fov));
  if (PathExists(DatasetInfoPath(folder))) {
    return InvalidArgument("{}: a folder of tilegrad dataset: name a model of it, --model CLASS/ID",
                           folder.string());
  }
  if (IsFile(folder)) {
    return InvalidArgument(
        "{}: a file; a fit takes the folder of transforms.json and its images, or of COLMAP",
        folder.string());
  }
  if (!PathExists(folder)) return NotFound("{}: no such folder", folder.string());
  if (!bare.empty()) {
    input->posed = false;
    return bare;
  }
  return NotFound(
      "{}: neither transforms.json nor transforms_train.json nor a COLMAP model nor pictures in it "
      "(docs/fit.md "
      "says what a fit reads)",
      folder.string());
}

Result<int> FindModel(const Dataset& dataset, const std::string& name) {
  for (std::size_t i = 0; i < dataset.models().size(); ++i) {
    const ModelInfo& model = dataset.models()[i];
    const std::string& of = dataset.info().classes[static_cast<std::size_t>(model.class_index)];
    if (of + "/" + model.id == name) return static_cast<int>(i);
  }
  return NotFound("{}: no model \"{}\" in it; models.jsonl lists them, as CLASS/ID",
                  dataset.folder().string(), name);
}

}  // namespace

TargetImages TargetsOfPlanar(std::span<const std::uint8_t> bytes, int size) {
  TargetImages out;
  out.width = out.height = size;
  const std::size_t plane = out.pixels(), views = bytes.size() / (4 * plane);
  out.color.resize(3 * plane * views), out.alpha.resize(plane * views);
  for (std::size_t n = 0; n < views; ++n) {
    const std::uint8_t* from = &bytes[4 * plane * n];
    for (std::size_t p = 0; p < plane; ++p) {
      const float alpha = static_cast<float>(from[3 * plane + p]) / 255;
      out.alpha[n * plane + p] = alpha;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = static_cast<float>(from[c * plane + p]) / 255;
        out.color[(3 * n + c) * plane + p] = alpha > 0 ? std::min(value / alpha, 1.0f) : 0.0f;
      }
    }
  }
  return out;
}

Result<FitInput> ReadFitFolder(const Path& folder, const InputOptions& options) {
  FitInput input;
  TILEGRAD_ASSIGN(const auto frames, ReadFrames(folder, options.fov, &input));
  TILEGRAD_TRY(AddViews(frames, options.watch, &input));
  const Path test = folder / "transforms_test.json";
  const bool has_test = PathExists(test);
  if (has_test && options.hold_out > 0) {
    return InvalidArgument(
        "{}: already says which views are held out: leave out --hold-out, or that file",
        test.string());
  }
  HoldOut(options.hold_out, &input);
  if (has_test && input.posed) {
    TILEGRAD_ASSIGN(const auto more, ReadTransforms(test));
    for (std::size_t i = 0; i < more.size(); ++i)
      input.held_out.push_back(static_cast<int>(frames.size() + i));
    TILEGRAD_TRY(AddViews(more, options.watch, &input));
  }
  TILEGRAD_TRY(ApplyBackground(options.background, &input, options.watch));
  TILEGRAD_TRY(Finish(&input));
  return input;
}

Result<FitInput> ReadFitDataset(const Path& folder, const std::string& model, int hold_out) {
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(folder));
  TILEGRAD_ASSIGN(const int index, FindModel(dataset, model));
  TILEGRAD_ASSIGN(ModelData data, dataset.Load(index));
  FitInput input;
  input.images = TargetsOfPlanar(data.images, dataset.info().image_size);
  const auto views = static_cast<std::size_t>(dataset.info().views);
  for (std::size_t i = 0; i < views; ++i) {
    input.cameras.push_back(dataset.info().camera.View(static_cast<int>(i)));
    input.names.push_back(fmt::format("view {}", i));
  }
  input.occupancy = std::move(data.occupancy);
  HoldOut(hold_out, &input);
  TILEGRAD_TRY(Finish(&input));
  return input;
}

TargetImages Reduce(const TargetImages& images, int factor) {
  if (factor == 1) return images;
  TargetImages out;
  out.width = images.width / factor, out.height = images.height / factor;
  const std::size_t views = images.alpha.size() / images.pixels(), plane = out.pixels();
  out.color.resize(3 * plane * views), out.alpha.resize(plane * views);
  const auto wide = static_cast<std::size_t>(images.width), f = static_cast<std::size_t>(factor);
  const auto width = static_cast<std::size_t>(out.width);
  for (std::size_t i = 0; i < plane * views; ++i) {
    const std::size_t n = i / plane, x = i % plane % width, y = i % plane / width;
    float alpha = 0, color[3] = {};
    for (std::size_t s = 0; s < f * f; ++s) {
      const std::size_t p = (y * f + s / f) * wide + x * f + s % f;
      const float a = images.alpha[n * images.pixels() + p];
      alpha += a;
      for (std::size_t c = 0; c < 3; ++c) {
        color[c] += a * images.color[(3 * n + c) * images.pixels() + p];
      }
    }
    out.alpha[i] = alpha / static_cast<float>(f * f);
    for (std::size_t c = 0; c < 3; ++c) {
      out.color[(3 * n + c) * plane + i % plane] = alpha > 0 ? color[c] / alpha : 0.0f;
    }
  }
  return out;
}

Result<Sphere> GuessSphere(const FitInput& input) {
  // sum over axes (c, d) of (1 - d d^T) (p - c) = 0
  glm::dmat3 sum(0);
  glm::dvec3 right(0);
  for (const int i : input.training) {
    const Camera& camera = input.cameras[static_cast<std::size_t>(i)];
    const float *r = camera.rotation, *t = camera.translation;
    const glm::dvec3 d(r[6], r[7], r[8]);
    glm::dvec3 c(0);
    for (int k = 0; k < 3; ++k)
      c -= static_cast<double>(t[k]) * glm::dvec3(r[3 * k], r[3 * k + 1], r[3 * k + 2]);
    const glm::dmat3 across = glm::dmat3(1) - glm::outerProduct(d, d);
    sum += across, right += across * c;
  }
  // All axes parallel: any point on them serves; the least trace keeps it near the cameras' middle.
  sum += glm::dmat3(1e-9);
  const glm::dvec3 centre = glm::inverse(sum) * right;
  double radius = 0;
  const std::size_t plane = input.images.pixels();
  for (const int i : input.training) {
    const auto n = static_cast<std::size_t>(i);
    const Camera& camera = input.cameras[n];
    const float* r = camera.rotation + 6;
    const double depth = -(r[0] * centre.x + r[1] * centre.y + r[2] * centre.z +
                           static_cast<double>(camera.translation[2]));
    if (!(depth > static_cast<double>(camera.near_plane))) {
      return InvalidArgument(
          "{}: the point that all cameras look at is behind it: check the "
          "cameras' convention, or give a mesh to start from",
          input.names[n]);
    }
    double area = 0;
    for (std::size_t p = 0; p < plane; ++p) area += input.images.alpha[n * plane + p];
    radius += depth / std::sqrt(static_cast<double>(camera.fx) * camera.fy) *
              std::sqrt(area / std::numbers::pi);
  }
  radius /= static_cast<double>(input.training.size());
  if (!(radius > 0)) return InvalidArgument("all masks are empty: there is nothing to fit");
  return Sphere{glm::vec3(centre), static_cast<float>(radius)};
}

}  // namespace tilegrad::train
