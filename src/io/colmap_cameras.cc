// SPDX-License-Identifier: Apache-2.0
// COLMAP's sparse models: reads cameras.txt and images.txt, or the same as .bin (little-endian);
// finds a project's models; writes text.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "io/camera_file.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

using Bend = LensDistortion::Model;

// COLMAP's models begin with one or two focal lengths, then the principal point; what follows are
// the first coefficients of a LensDistortion, or without `bend` something that is not read.
struct Model {
  std::string_view name;
  int id;
  std::size_t focals, params;
  std::optional<Bend> bend;
};
constexpr std::array<Model, 12> kModels = {
    {{"SIMPLE_PINHOLE", 0, 1, 3, Bend::kBrown},
     {"PINHOLE", 1, 2, 4, Bend::kBrown},
     {"SIMPLE_RADIAL", 2, 1, 4, Bend::kBrown},
     {"RADIAL", 3, 1, 5, Bend::kBrown},
     {"OPENCV", 4, 2, 8, Bend::kBrown},
     {"OPENCV_FISHEYE", 5, 2, 8, Bend::kFisheye},
     {"FULL_OPENCV", 6, 2, 12, Bend::kBrown},
     {"FOV", 7, 2, 5, std::nullopt},
     {"SIMPLE_RADIAL_FISHEYE", 8, 1, 4, Bend::kFisheye},
     {"RADIAL_FISHEYE", 9, 1, 5, Bend::kFisheye},
     {"THIN_PRISM_FISHEYE", 10, 2, 12, std::nullopt},
     {"RAD_TAN_THIN_PRISM_FISHEYE", 11, 2, 16, std::nullopt}}};
constexpr std::size_t kMaxParams = 16;

struct Intrinsics {
  ColmapCamera camera;
  ImageSize size;
  LensDistortion lens;
};
// Errors of a camera matter only if an image uses it.
using Cameras = std::map<std::uint32_t, Result<Intrinsics>>;

struct RawCamera {
  std::uint32_t id = 0;
  std::uint64_t width = 0, height = 0;
  std::array<double, kMaxParams> params = {};
};

// Of integers of any type.
template <class T>
bool IsSize(T width, T height) {
  constexpr T kMaxSide = 1 << 20;
  return width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide;
}

Result<Intrinsics> MakeIntrinsics(const RawCamera& raw, const Model& model,
                                  const std::string& place) {
  if (!model.bend) {
    return InvalidArgument(
        "{}: camera {} ({}) has lens distortion; undistort the images first (colmap "
        "image_undistorter) and use the model that it writes",
        place, raw.id, model.name);
  }
  if (!IsSize(raw.width, raw.height)) {
    return DataLoss("{}: camera {} has an image of {} x {} pixels", place, raw.id, raw.width,
                    raw.height);
  }
  const double* middle = &raw.params[model.focals];
  std::array<double, 8> k = {};
  std::copy_n(middle + 2, model.params - model.focals - 2, k.begin());
  if (!std::ranges::all_of(k, [](double x) { return std::isfinite(x); }))
    return DataLoss("{}: camera {} has a number that is not finite", place, raw.id);
  return Intrinsics{
      {.fx = raw.params[0], .fy = middle[-1], .cx = middle[0], .cy = middle[1]},
      {static_cast<int>(raw.width), static_cast<int>(raw.height)},
      *model.bend == Bend::kFisheye ? FisheyeLens({k[0], k[1], k[2], k[3]}) : BrownLens(k)};
}

std::string KnownModels() {
  std::string list;
  for (const Model& m : kModels)
    if (m.bend) list += (list.empty() ? "" : ", ") + std::string(m.name);
  return list;
}

// `camera` has the pose, the rest comes from the camera that the image names.
Status AddView(const std::string& place, const Cameras& cameras, std::uint32_t camera_id,
               ColmapCamera camera, const std::string& name, std::vector<CameraView>* views) {
  const auto found = cameras.find(camera_id);
  if (found == cameras.end())
    return DataLoss("{}: image \"{}\" uses camera {}, which does not exist", place, name,
                    camera_id);
  if (!found->second.ok()) return found->second.status();
  const ColmapCamera& k = found->second->camera;
  camera.fx = k.fx;
  camera.fy = k.fy;
  camera.cx = k.cx;
  camera.cy = k.cy;
  const auto converted = FromColmap(camera);
  if (!converted.ok())
    return DataLoss("{}: image \"{}\": {}", place, name, converted.status().message());
  views->push_back({name, *converted, found->second->size, found->second->lens});
  return {};
}

// Text ----------------------------------------------------------------------------------------

bool IsComment(std::string_view line) { return NextToken(line).starts_with('#'); }

template <class... T>
bool ParseTokens(std::string_view& line, T&... values) {
  return (ParseNumber(NextToken(line), values) && ...);
}

Result<Cameras> ReadCamerasText(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  Cameras cameras;
  Lines lines(text);
  for (std::string_view line; lines.Next(line);) {
    if (IsComment(line) || line.find_first_not_of(" \t") == line.npos) continue;
    const std::string place = fmt::format("{}: line {}", file.string(), lines.Number());
    RawCamera raw;
    if (!ParseTokens(line, raw.id)) return DataLoss("{}: no camera number", place);
    const std::string_view name = NextToken(line);
    const auto model = std::ranges::find(kModels, name, &Model::name);
    if (model == kModels.end()) {
      cameras.insert_or_assign(
          raw.id, DataLoss("{}: camera model \"{}\" is not one of {}", place, name, KnownModels()));
      continue;
    }
    bool good = ParseTokens(line, raw.width, raw.height);
    for (std::size_t i = 0; i < model->params; ++i) good = good && ParseTokens(line, raw.params[i]);
    if (!good || !NextToken(line).empty()) {
      return DataLoss("{}: expected CAMERA_ID {} WIDTH HEIGHT and {} numbers", place, name,
                      model->params);
    }
    cameras.insert_or_assign(raw.id, MakeIntrinsics(raw, *model, place));
  }
  return cameras;
}

Status ReadImageLine(std::string_view line, const std::string& place, const Cameras& cameras,
                     std::vector<CameraView>* views) {
  std::uint32_t id = 0, camera_id = 0;
  ColmapCamera c;
  auto& [w, x, y, z] = c.quaternion;
  auto& t = c.translation;
  const bool good = ParseTokens(line, id, w, x, y, z, t[0], t[1], t[2], camera_id);
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  if (!good || line.empty())
    return DataLoss("{}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", place);
  return AddView(place, cameras, camera_id, c, std::string(line), views);
}

// The points of an image, X Y POINT3D_ID each. An image line has ten words, of which the last is a
// name: it is no such line even if the name is a number.
bool IsPoints(std::string_view line) {
  std::size_t count = 0;
  double number = 0;
  for (std::string_view word = NextToken(line); !word.empty(); word = NextToken(line), ++count) {
    if (!ParseNumber(word, number)) return false;
  }
  return count % 3 == 0;
}

// COLMAP writes two lines per image, the second with its points, which may be empty. Other programs
// omit it, and filters of empty lines drop it.
Result<std::vector<CameraView>> ReadImagesText(const Path& file, const Cameras& cameras) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::vector<CameraView> views;
  Lines lines(text);
  bool after_image = false;
  for (std::string_view line; lines.Next(line);) {
    if (IsComment(line)) continue;
    const bool empty = line.find_first_not_of(" \t") == line.npos;
    const bool points = after_image && IsPoints(line);
    after_image = false;
    if (empty || points) continue;
    const std::string place = fmt::format("{}: line {}", file.string(), lines.Number());
    TILEGRAD_TRY(ReadImageLine(line, place, cameras, &views));
    after_image = true;
  }
  return views;
}

// Binary --------------------------------------------------------------------------------------

class BinaryReader {
 public:
  explicit BinaryReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}

  template <class... T>
  bool Read(T&... values) {
    return (ReadOne(values) && ...);
  }
  bool ReadName(std::string* name) {
    const auto end = std::find(left_.begin(), left_.end(), 0);
    if (end == left_.end()) return false;
    name->assign(left_.begin(), end);
    left_ = left_.subspan(name->size() + 1);
    return true;
  }
  bool Skip(std::uint64_t count, std::size_t size) {
    if (count > left_.size() / size) return false;
    left_ = left_.subspan(count * size);
    return true;
  }

 private:
  template <class T>
  bool ReadOne(T& value) {
    if (left_.size() < sizeof(T)) return false;
    std::memcpy(&value, left_.data(), sizeof(T));
    left_ = left_.subspan(sizeof(T));
    return true;
  }

  std::span<const std::uint8_t> left_;
};

Status CutShort(const Path& file) {
  return DataLoss("{}: the file ends in the middle", file.string());
}

Result<Cameras> ReadCamerasBinary(const Path& file) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(file));
  BinaryReader in(bytes);
  Cameras cameras;
  std::uint64_t count = 0;
  if (!in.Read(count)) return CutShort(file);
  for (; count > 0; --count) {
    RawCamera raw;
    std::int32_t id = 0;
    if (!in.Read(raw.id, id, raw.width, raw.height)) return CutShort(file);
    const auto model = std::ranges::find(kModels, id, &Model::id);
    if (model == kModels.end()) {
      return DataLoss("{}: camera {} has model number {}; supported are {}", file.string(), raw.id,
                      id, KnownModels());
    }
    for (std::size_t i = 0; i < model->params; ++i) {
      if (!in.Read(raw.params[i])) return CutShort(file);
    }
    cameras.insert_or_assign(raw.id, MakeIntrinsics(raw, *model, file.string()));
  }
  return cameras;
}

Result<std::vector<CameraView>> ReadImagesBinary(const Path& file, const Cameras& cameras) {
  TILEGRAD_ASSIGN(const Bytes bytes, ReadFile(file));
  BinaryReader in(bytes);
  std::vector<CameraView> views;
  std::uint64_t count = 0, points = 0;
  if (!in.Read(count)) return CutShort(file);
  for (; count > 0; --count) {
    std::uint32_t id = 0, camera_id = 0;
    ColmapCamera camera;
    std::string name;
    constexpr std::size_t kPointBytes = 24;  // x, y, the number of the 3D point
    if (!in.Read(id, camera.quaternion, camera.translation, camera_id) || !in.ReadName(&name) ||
        !in.Read(points) || !in.Skip(points, kPointBytes)) {
      return CutShort(file);
    }
    TILEGRAD_TRY(AddView(file.string(), cameras, camera_id, camera, name, &views));
  }
  return views;
}

// Of one point, its error is read, and the images that see it are skipped.
bool ReadPointError(BinaryReader* in, double* error) {
  constexpr std::size_t kSeenBytes = 8;  // numbers of the image and of the point in it
  std::uint64_t id = 0, seen = 0;
  std::array<double, 3> place;
  std::array<std::uint8_t, 3> color;
  return in->Read(id, place, color, *error, seen) && in->Skip(seen, kSeenBytes);
}

// Projects ------------------------------------------------------------------------------------

// Poses alone are a model that lacks its cameras.
bool IsModel(const Path& folder) {
  return std::ranges::any_of(std::array{"cameras.txt", "cameras.bin", "images.bin"},
                             [&](const char* name) { return IsFile(folder / name); });
}

// In a folder `sparse`, sorted.
std::vector<Path> ModelsIn(const Path& sparse) {
  std::vector<Path> models;
  std::error_code error;
  for (std::filesystem::directory_iterator at(sparse, error), end; !error && at != end;
       at.increment(error)) {
    if (IsModel(at->path())) models.push_back(at->path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

// 0 if they cannot be read.
std::size_t CountImages(const Path& model) {
  const auto views = LoadColmapCameras(model, {.bent = true});
  return views.ok() ? views->size() : 0;
}

ColmapModel LargestOf(const std::vector<Path>& models) {
  std::vector<std::size_t> counts;
  for (const Path& model : models) counts.push_back(CountImages(model));
  const auto best =
      static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  std::string others;
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (i != best) others += fmt::format(", {} ({})", models[i].filename().string(), counts[i]);
  }
  return {models[best],
          fmt::format("{}: taken for its {}; other models of the project are left out: {}",
                      models[best].string(), Count(counts[best], "image"), others.substr(2))};
}

// Writing -------------------------------------------------------------------------------------

// Refuses what the reader would refuse or read under another name.
Status CheckForColmap(const CameraView& view, const ColmapCamera& camera) {
  const auto [width, height] = view.size;
  if (!IsSize(width, height))
    return InvalidArgument("\"{}\" has an image of {} x {} pixels", view.name, width, height);
  if (view.name.empty()) return InvalidArgument("a view has no name, which COLMAP's text needs");
  const bool one_line = view.name.find_first_of(std::string_view("\n\r\0", 3)) == std::string::npos;
  if (!one_line || view.name.starts_with(' ') || view.name.starts_with('\t')) {
    return InvalidArgument(
        "\"{}\" cannot be a name in COLMAP's text: it begins with a space or has "
        "a line break",
        view.name);
  }
  TILEGRAD_TRY(Validate(view.camera).Within(view.name));  // a quaternion would hide a mirror
  return FromColmap(camera).status().Within(view.name);
}

}  // namespace

std::optional<ColmapModel> FindColmapModel(const Path& folder) {
  for (const Path& root : {folder, folder / "colmap"}) {
    if (IsModel(root)) return ColmapModel{root, ""};
    const std::vector<Path> models = ModelsIn(root / "sparse");
    if (models.size() > 1) return LargestOf(models);
    if (models.size() == 1) return ColmapModel{models[0], ""};
    if (IsModel(root / "sparse")) return ColmapModel{root / "sparse", ""};
  }
  return std::nullopt;
}

std::optional<double> ColmapPointError(const Path& folder) {
  const auto bytes = ReadFile(folder / "points3D.bin");
  if (!bytes.ok()) return std::nullopt;
  BinaryReader in(*bytes);
  std::uint64_t count = 0;
  if (!in.Read(count) || count == 0) return std::nullopt;
  double sum = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    double error = 0;
    if (!ReadPointError(&in, &error)) return std::nullopt;
    sum += error;
  }
  return sum / static_cast<double>(count);
}

Result<std::vector<CameraView>> LoadColmapCameras(const Path& folder,
                                                  const CameraFileOptions& options) {
  const auto model = FindColmapModel(folder);
  if (!model) {
    return NotFound(
        "{}: not a COLMAP model: neither cameras.txt nor cameras.bin is in it or its sparse/0",
        folder.string());
  }
  if (!model->note.empty() && options.warn) options.warn(model->note);
  const Path& at = model->folder;
  const bool text = IsFile(at / "cameras.txt");
  TILEGRAD_ASSIGN(const Cameras cameras, text ? ReadCamerasText(at / "cameras.txt")
                                              : ReadCamerasBinary(at / "cameras.bin"));
  TILEGRAD_ASSIGN(auto views, text ? ReadImagesText(at / "images.txt", cameras)
                                   : ReadImagesBinary(at / "images.bin", cameras));
  if (views.empty()) return DataLoss("{}: no images in it", at.string());
  for (const CameraView& view : views) {
    if (options.bent) break;
    TILEGRAD_TRY(CheckStraight(view.lens).Within(at.string() + ": " + view.name));
  }
  return views;
}

std::vector<Path> ColmapFiles(const Path& folder) {
  return {folder / "cameras.txt", folder / "points3D.txt", folder / "images.txt"};
}

Status SaveColmapCameras(const Path& folder, std::span<const CameraView> views) {
  if (views.empty()) return InvalidArgument("{}: no views to write", folder.string());
  std::string cameras = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n";
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points\n";
  for (std::size_t i = 0; i < views.size(); ++i) {
    const ColmapCamera c = ToColmap(views[i].camera);
    TILEGRAD_TRY(CheckForColmap(views[i], c).Within(folder.string()));
    const auto& [q, t, fx, fy, cx, cy] = c;
    cameras += fmt::format("{} PINHOLE {} {} {} {} {} {}\n", i + 1, views[i].size.width,
                           views[i].size.height, fx, fy, cx, cy);
    images += fmt::format("{} {} {} {} {} {} {} {} {} {}\n\n", i + 1, q[0], q[1], q[2], q[3], t[0],
                          t[1], t[2], i + 1, views[i].name);
  }
  const std::vector<Path> files = ColmapFiles(folder);
  TILEGRAD_TRY(WriteTextAtomic(files[0], cameras));
  TILEGRAD_TRY(WriteTextAtomic(files[1], "# none\n"));
  return WriteTextAtomic(files[2], images);
}

}  // namespace tilegrad::io
