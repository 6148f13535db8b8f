// SPDX-License-Identifier: Apache-2.0
// The third form of photographs.h: a folder of pictures with alpha or masks.
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/json_text.h"
#include "io/camera_file.h"
#include "io/image_file.h"
#include "train/data/cutout.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {
namespace {

using ParsedJson = nlohmann::json;

constexpr const char* kTrain = "transforms_train.json";
constexpr const char* kTest = "transforms_test.json";
constexpr int kTestEvery = 6;  // the last of each six pictures is held out
constexpr std::size_t kMostNames = 256;
constexpr double kFarthest = 1 << 20;  // pixels from the picture's corner that a keypoint may be

// masks/<name>.png of a picture without alpha.
Result<ImageU8> Masked(const Path& folder, const Path& picture) {
  TILEGRAD_ASSIGN(ImageU8 image, io::LoadImage(picture));
  const Path mask = folder / "masks" / (picture.stem().string() + ".png");
  if (!PathExists(mask)) return io::ToColor(std::move(image));
  TILEGRAD_ASSIGN(const ImageU8 values, io::LoadImage(mask));
  const ImageU8 color = io::ToColor(std::move(image));
  ImageU8 rgb(color.width, color.height, 3);
  for (std::size_t i = 0; i < rgb.pixels.size(); ++i)
    rgb.pixels[i] = color.pixels[i / 3 * static_cast<std::size_t>(color.channels) + i % 3];
  auto both = WithMask(rgb, values);
  if (!both.ok()) return both.status().Within(mask.string());
  return both;
}

Status SetMask(const ImageU8& rgba, Photograph* photo) {
  if (rgba.channels != 4)
    return InvalidArgument("{}: no alpha, and no mask in masks/{}.png", photo->image.string(),
                           photo->image.stem().string());
  photo->mask = {rgba.width, rgba.height, {}};
  photo->box = {1e9, 1e9, -1e9, -1e9};
  for (int y = 0; y < rgba.height; ++y) {
    for (int x = 0; x < rgba.width; ++x) {
      const bool inside = rgba.at(x, y)[3] >= 128;
      photo->mask.inside.push_back(inside);
      if (!inside) continue;
      PhotoBox& box = photo->box;
      box.left = std::min(box.left, double(x));
      box.right = std::max(box.right, x + 1.0);
      box.top = std::min(box.top, double(y));
      box.bottom = std::max(box.bottom, y + 1.0);
    }
  }
  if (photo->box.right > photo->box.left) return {};
  return InvalidArgument("{}: its mask is empty", photo->image.string());
}

class FolderReader {
 public:
  explicit FolderReader(Path folder) : folder_(std::move(folder)) {}

  // `names` of pictures in the folder `place`.
  Result<PhotographSet> Read(const Path& place, const std::vector<Path>& names) {
    set_.folder = folder_;
    set_.source = "photographs";
    int index = 0;
    for (const Path& name : names) {
      Photograph photo;
      photo.id = name.string();
      photo.image = place / name;
      photo.split = ++index % kTestEvery == 0 ? Split::kTest : Split::kTrain;
      TILEGRAD_ASSIGN(const ImageU8 image, Masked(folder_, photo.image));
      TILEGRAD_TRY(SetMask(image, &photo));
      set_.photographs.push_back(std::move(photo));
    }
    TILEGRAD_TRY(ReadCameras());
    if (Has("keypoints.json")) TILEGRAD_TRY(ReadKeypoints());
    return std::move(set_);
  }

 private:
  bool Has(const char* name) const { return PathExists(folder_ / name); }

  // The files of `tilegrad views` and NeRF's datasets, which say what is held out.
  Result<std::vector<io::CameraView>> ReadSplitCameras() {
    TILEGRAD_ASSIGN(std::vector<io::CameraView> all, io::LoadCameras(folder_ / kTrain, {}));
    if (!Has(kTest)) return all;
    TILEGRAD_ASSIGN(const auto held_out, io::LoadCameras(folder_ / kTest, {}));
    std::set<std::string> stems;
    for (const io::CameraView& view : held_out) stems.insert(Path(view.name).stem().string());
    for (Photograph& photo : set_.photographs)
      photo.split = stems.contains(photo.image.stem().string()) ? Split::kTest : Split::kTrain;
    all.insert(all.end(), held_out.begin(), held_out.end());
    return all;
  }

  Status ReadCameras() {
    Result<std::vector<io::CameraView>> cameras = std::vector<io::CameraView>();
    if (io::FindColmapModel(folder_).has_value())
      cameras = io::LoadColmapCameras(folder_);
    else if (Has("transforms.json"))
      cameras = io::LoadCameras(folder_ / "transforms.json", {});
    else if (Has(kTrain))
      cameras = ReadSplitCameras();
    TILEGRAD_TRY(cameras.status());
    if (cameras->empty()) return {};
    std::map<std::string, const io::CameraView*> by_stem;
    for (const io::CameraView& view : *cameras) by_stem[Path(view.name).stem().string()] = &view;
    for (Photograph& photo : set_.photographs) {
      const auto found = by_stem.find(photo.image.stem().string());
      if (found == by_stem.end())
        return InvalidArgument("{}: no camera for it among the {} of {}", photo.image.string(),
                               cameras->size(), folder_.string());
      const io::CameraView& view = *found->second;
      const Camera64 resized =
          ResizeCamera(view.camera, view.size, {photo.mask.width, photo.mask.height});
      auto weak = WeakPerspectiveOf(resized, {0, 0, 0});
      if (!weak.ok()) return weak.status().Within(photo.image.string());
      photo.camera = *weak;
    }
    return {};
  }

  Result<int> IndexOf(const ParsedJson& name) const {
    const auto found = name.is_string()
                           ? std::ranges::find(set_.keypoint_names, name.get<std::string>())
                           : set_.keypoint_names.end();
    if (found == set_.keypoint_names.end())
      return InvalidArgument("{}: {} is not one of its \"names\"", file_, DumpJson(name));
    return static_cast<int>(found - set_.keypoint_names.begin());
  }

  // [[a, b], ...] of names.
  Result<std::vector<std::pair<int, int>>> Pairs(const ParsedJson& json, const char* key) const {
    std::vector<std::pair<int, int>> out;
    const auto found = json.find(key);
    if (found == json.end()) return out;
    if (!found->is_array()) return InvalidArgument("{}: \"{}\" is not a list of pairs", file_, key);
    for (const ParsedJson& pair : *found) {
      if (!pair.is_array() || pair.size() != 2)
        return InvalidArgument("{}: \"{}\" is not a list of pairs of names", file_, key);
      TILEGRAD_ASSIGN(const int a, IndexOf(pair[0]));
      TILEGRAD_ASSIGN(const int b, IndexOf(pair[1]));
      out.emplace_back(a, b);
    }
    return out;
  }

  Status ReadNames(const ParsedJson& json) {
    const auto names = json.find("names");
    if (names == json.end() || !names->is_array() || names->empty() || names->size() > kMostNames)
      return InvalidArgument("{}: \"names\" has to be a list of 1 to {} names", file_, kMostNames);
    for (const ParsedJson& name : *names) {
      if (!name.is_string()) return InvalidArgument("{}: {} is not a name", file_, DumpJson(name));
      if (IndexOf(name).ok())
        return InvalidArgument("{}: \"names\" has {} twice", file_, DumpJson(name));
      set_.keypoint_names.push_back(name.get<std::string>());
    }
    TILEGRAD_ASSIGN(const auto sides, Pairs(json, "mirror"));
    for (std::size_t k = 0; k < names->size(); ++k) set_.mirror.push_back(static_cast<int>(k));
    for (const auto& [left, right] : sides) {
      int &of_left = set_.mirror[static_cast<std::size_t>(left)],
          &of_right = set_.mirror[static_cast<std::size_t>(right)];
      if (left == right || of_left != left || of_right != right)
        return InvalidArgument("{}: \"mirror\" has {} or {} twice", file_, DumpJson((*names)[left]),
                               DumpJson((*names)[right]));
      std::swap(of_left, of_right);
      views_.left.emplace_back(right, left);
    }
    TILEGRAD_ASSIGN(views_.up, Pairs(json, "up"));
    TILEGRAD_ASSIGN(views_.front, Pairs(json, "front"));
    return {};
  }

  Result<Keypoint> ReadKeypoint(const ParsedJson& json, const std::string& where) const {
    if (json.is_null()) return Keypoint{};
    if (!json.is_array() || json.size() != 2 || !json[0].is_number() || !json[1].is_number())
      return InvalidArgument("{}: {}: {} is neither [x, y] nor null", file_, where, DumpJson(json));
    const Keypoint keypoint{json[0].get<double>(), json[1].get<double>(), true};
    if (!(std::max(std::abs(keypoint.x), std::abs(keypoint.y)) <= kFarthest))
      return InvalidArgument("{}: {}: {} is more than {} pixels away", file_, where, DumpJson(json),
                             kFarthest);
    return keypoint;
  }

  Status ReadPlaces(const ParsedJson& json) {
    const auto places = json.find("photographs");
    if (places == json.end() || !places->is_object())
      return InvalidArgument("{}: no \"photographs\" in it", file_);
    for (Photograph& photo : set_.photographs) {
      const auto found = places->find(photo.id);
      if (found == places->end() || !found->is_array() ||
          found->size() != set_.keypoint_names.size())
        return InvalidArgument("{}: \"{}\" needs {} keypoints, each [x, y] or null", file_,
                               photo.id, set_.keypoint_names.size());
      for (const ParsedJson& place : *found) {
        TILEGRAD_ASSIGN(const Keypoint keypoint, ReadKeypoint(place, photo.id));
        photo.keypoints.push_back(keypoint);
      }
    }
    return {};
  }

  Status ReadKeypoints() {
    file_ = (folder_ / "keypoints.json").string();
    TILEGRAD_ASSIGN(const std::string text, ReadText(file_));
    if (FirstNestedDeeper(text, 16) != std::string::npos)
      return InvalidArgument("{}: nested too deeply", file_);
    const ParsedJson json = ParseJsonOrDiscard(text);
    if (!json.is_object()) return InvalidArgument("{}: not a JSON object", file_);
    TILEGRAD_TRY(ReadNames(json));
    TILEGRAD_TRY(ReadPlaces(json));
    const bool known = set_.photographs[0].camera.has_value();
    return known ? PlaceKeypoints() : FindCameras();
  }

  Status FindCameras() {
    views_.mirror = set_.mirror;
    for (const Photograph& photo : set_.photographs) views_.views.push_back(photo.keypoints);
    auto found = FactorizeKeypoints(views_);
    if (!found.ok()) return found.status().Within(file_);
    set_.mean_keypoints = found->shape;
    for (std::size_t i = 0; i < set_.photographs.size(); ++i)
      set_.photographs[i].camera = found->cameras[i];
    return {};
  }

  // Where cameras are known: the points that they see at the keypoints, in the mean.
  Status PlaceKeypoints() {
    std::vector<std::vector<Keypoint>> views;
    std::vector<WeakPerspective> cameras;
    for (const Photograph& photo : set_.photographs) {
      views.push_back(photo.keypoints);
      cameras.push_back(*photo.camera);
    }
    set_.mean_keypoints = LocateKeypoints(views, cameras);
    return {};
  }

  Path folder_;
  std::string file_;
  PhotographSet set_;
  KeypointViews views_;
};

}  // namespace

Result<std::optional<PhotographSet>> OpenPhotoFolder(const Path& folder) {
  const Path images = folder / "images";
  const Path place = IsFolder(images) ? images : folder;
  const io::PictureNames pictures = io::PicturesIn(place);
  if (!pictures.others.empty())
    return InvalidArgument("{}: {}; convert them or remove them from the folder", place.string(),
                           pictures.DescribeOthers());
  if (pictures.read.empty()) return std::optional<PhotographSet>();
  TILEGRAD_ASSIGN(PhotographSet set, FolderReader(folder).Read(place, pictures.read));
  return std::optional(std::move(set));
}

}  // namespace tilegrad::train
