// SPDX-License-Identifier: Apache-2.0
// CUB-200 and PASCAL3D+ as CMR's code lays them out.
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "io/mat_file.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

const std::array<const char*, 15> kCubKeypoints = {"Back",  "Beak", "Belly", "Breast", "Crown",
                                                   "FHead", "LEye", "LLeg",  "LWing",  "Nape",
                                                   "REye",  "RLeg", "RWing", "Tail",   "Throat"};

std::vector<int> CubMirror() { return {0, 1, 2, 3, 4, 5, 10, 11, 12, 9, 6, 7, 8, 13, 14}; }

namespace {

using io::MatPlace;

constexpr std::size_t kMostKeypoints = 256;
// A rotation printed with few digits; as camera_conventions.h.
constexpr double kTolerance = 1e-2;

// In the order in which they are looked for.
constexpr std::array kPascal3dClasses = {"car",       "aeroplane", "bicycle", "boat",
                                         "bottle",    "bus",       "chair",   "diningtable",
                                         "motorbike", "sofa",      "train",   "tvmonitor"};

struct Layout {
  Path data, sfm, images;
  std::string class_name;  // empty: CUB
};

std::optional<Path> FirstThere(const Path& folder, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (PathExists(folder / name)) return folder / name;
  }
  return std::nullopt;
}

std::optional<Layout> FindCub(const Path& folder) {
  for (const char* below : {".", "cub", "cachedir/cub"}) {
    const Path base = (folder / below).lexically_normal();
    if (!PathExists(base / "data/train_cub_cleaned.mat")) continue;
    const auto images = FirstThere(folder, {"CUB_200_2011/images", "images"});
    return Layout{base / "data", base / "sfm", images.value_or(folder / "CUB_200_2011/images"), ""};
  }
  return std::nullopt;
}

std::optional<Layout> FindPascal(const Path& folder) {
  for (const char* below : {".", "p3d", "cachedir/p3d"}) {
    const Path base = (folder / below).lexically_normal(), data = base / "data";
    if (!IsFolder(data)) continue;
    for (const char* name : kPascal3dClasses) {
      if (!PathExists(data / (std::string(name) + "_kps.mat"))) continue;
      const auto images = FirstThere(folder, {"PASCAL3D+_release1.1/Images", "Images"});
      return Layout{data, base / "sfm", images.value_or(folder / "Images"), name};
    }
  }
  return std::nullopt;
}

// parts: 3 x K, columns x, y, visible.
Result<std::vector<Keypoint>> ReadKeypoints(const MatPlace& parts, std::size_t count) {
  TILEGRAD_TRY(parts.ExpectSize(3, count));
  std::vector<Keypoint> out(count);
  for (std::size_t k = 0; k < count; ++k) {
    const io::MatNumbers& n = parts.array().numbers;
    out[k] = {n[3 * k] - 0.5, n[3 * k + 1] - 0.5, n[3 * k + 2] > 0};
    if (out[k].visible && !(std::isfinite(out[k].x) && std::isfinite(out[k].y)))
      return InvalidArgument("{}: keypoint {} is visible, but has no position", parts.where(),
                             k + 1);
  }
  return out;
}

// Corners count from 1 and are pixels of the box.
Result<PhotoBox> ReadBox(const MatPlace& box) {
  double corners[4];
  std::size_t i = 0;
  for (const char* name : {"x1", "y1", "x2", "y2"}) {
    TILEGRAD_ASSIGN(const MatPlace field, box.Field(0, name));
    TILEGRAD_ASSIGN(corners[i++], field.Number());
  }
  const PhotoBox out{corners[0] - 1, corners[1] - 1, corners[2], corners[3]};
  if (out.right - out.left >= 1 && out.bottom - out.top >= 1) return out;
  return InvalidArgument("{}: an empty box ({}, {}) to ({}, {})", box.where(), corners[0],
                         corners[1], corners[2], corners[3]);
}

Result<PhotoMask> ReadMask(const MatPlace& mask) {
  const io::MatArray& array = mask.array();
  if (array.kind != io::MatKind::kNumbers || array.dims.size() != 2 || array.places() == 0)
    return InvalidArgument("{}: expected a mask, height x width", mask.where());
  const std::size_t height = array.dims[0], width = array.dims[1];
  if (width > 65536 || height > 65536)
    return InvalidArgument("{}: a mask of {} x {}", mask.where(), height, width);
  PhotoMask out{static_cast<int>(width), static_cast<int>(height), {}};
  out.inside.resize(width * height);
  std::size_t covered = 0;
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t y = 0; y < height; ++y) {
      const bool inside = array.numbers[x * height + y] > 0;
      out.inside[y * width + x] = inside;
      covered += inside ? 1 : 0;
    }
  }
  if (covered == 0) return InvalidArgument("{}: the mask is empty", mask.where());
  return out;
}

// Columns of `rot` come one after the other; `trans` counts pixels from 1, as keypoints do.
Result<WeakPerspective> ReadCamera(const MatPlace& anno, std::size_t index) {
  WeakPerspective out;
  TILEGRAD_ASSIGN(const MatPlace scale, anno.Field(index, "scale"));
  TILEGRAD_ASSIGN(out.scale, scale.Number());
  if (!(out.scale > 0)) return InvalidArgument("{}: a scale of {}", scale.where(), out.scale);
  TILEGRAD_ASSIGN(const MatPlace trans, anno.Field(index, "trans"));
  TILEGRAD_ASSIGN(const auto t, trans.Numbers(2));
  out.translation = {t[0] - 0.5, t[1] - 0.5};
  TILEGRAD_ASSIGN(const MatPlace rot, anno.Field(index, "rot"));
  TILEGRAD_TRY(rot.ExpectSize(3, 3));
  TILEGRAD_ASSIGN(const auto r, rot.Numbers(9));
  Mat3Array rotation;
  for (std::size_t i = 0; i < 9; ++i) rotation[i] = r[3 * (i % 3) + i / 3];
  out.quaternion = QuaternionOf(rotation);
  const Mat3Array back = RotationOf(out.quaternion);
  double off = 0;
  for (std::size_t i = 0; i < 9; ++i) off = std::max(off, std::abs(back[i] - rotation[i]));
  if (off <= kTolerance) return out;
  return InvalidArgument("{}: not a rotation (off by {:.2g})", rot.where(), off);
}

class CmrReader {
 public:
  CmrReader(Layout layout, BrokenMembers* broken) : layout_(std::move(layout)), broken_(broken) {}

  Result<PhotographSet> Read(const Path& folder) {
    set_.folder = folder;
    set_.source = layout_.class_name.empty() ? "cub" : "pascal3d";
    set_.class_name = layout_.class_name;
    TILEGRAD_TRY(ReadNames());
    for (const auto& [name, split] :
         {std::pair("train", Split::kTrain), {"val", Split::kValidation}, {"test", Split::kTest}}) {
      // PASCAL3D+ has no third part: what CMR validates on is what we test on.
      const bool pascal_val = split == Split::kValidation && !layout_.class_name.empty();
      TILEGRAD_TRY(ReadSplit(name, pascal_val ? Split::kTest : split));
    }
    return std::move(set_);
  }

 private:
  Status ReadNames() {
    if (layout_.class_name.empty()) {
      set_.keypoint_names.assign(kCubKeypoints.begin(), kCubKeypoints.end());
      set_.mirror = CubMirror();
      return {};
    }
    TILEGRAD_ASSIGN(const io::MatFile file,
                    io::LoadMat(layout_.data / (layout_.class_name + "_kps.mat")));
    TILEGRAD_ASSIGN(const MatPlace perm, MatPlace::Variable(file, "kp_perm_inds"));
    const std::size_t count = perm.places();
    if (count == 0 || count > kMostKeypoints)
      return InvalidArgument("{}: {} keypoints", perm.where(), count);
    TILEGRAD_ASSIGN(const auto numbers, perm.Numbers(count));
    for (const double n : numbers)
      set_.mirror.push_back(static_cast<int>(std::clamp(n, 0.0, double(kMostKeypoints) + 1)) - 1);
    for (std::size_t k = 0; k < count; ++k) {
      const int m = set_.mirror[k];
      if (m < 0 || m >= static_cast<int>(count) ||
          set_.mirror[static_cast<std::size_t>(m)] != static_cast<int>(k))
        return InvalidArgument("{}: keypoint {} and its mirror image {} do not match", perm.where(),
                               k + 1, numbers[k]);
      set_.keypoint_names.push_back(fmt::format("keypoint {}", k + 1));
    }
    return NameKeypoints(file, count);
  }

  // Where the file has names.
  Status NameKeypoints(const io::MatFile& file, std::size_t count) {
    const auto names = MatPlace::Variable(file, "kp_names");
    if (!names.ok()) return {};
    const io::MatArray& array = names->array();
    if (array.kind != io::MatKind::kCell || array.elements.size() != count)
      return InvalidArgument("{}: expected {} names", names->where(), count);
    for (std::size_t k = 0; k < count; ++k) {
      if (array.elements[k].kind == io::MatKind::kText)
        set_.keypoint_names[k] = array.elements[k].text;
    }
    return {};
  }

  Path AnnoFile(const std::string& part) const {
    const bool cub = layout_.class_name.empty();
    return layout_.data /
           (cub ? part + "_cub_cleaned.mat" : layout_.class_name + "_" + part + ".mat");
  }
  Path SfmFile(const std::string& part) const {
    return layout_.sfm /
           ((layout_.class_name.empty() ? "anno" : layout_.class_name) + ("_" + part + ".mat"));
  }

  Status ReadSplit(const std::string& part, Split split) {
    const Path anno_file = AnnoFile(part), sfm_file = SfmFile(part);
    if (part != "train" && !PathExists(anno_file)) return {};
    TILEGRAD_ASSIGN(const io::MatFile anno, io::LoadMat(anno_file));
    TILEGRAD_ASSIGN(const io::MatFile sfm, io::LoadMat(sfm_file));
    TILEGRAD_ASSIGN(const MatPlace images, MatPlace::Variable(anno, "images"));
    TILEGRAD_ASSIGN(const MatPlace cameras, MatPlace::Variable(sfm, "sfm_anno"));
    TILEGRAD_TRY(images.ExpectStruct());
    if (images.places() != cameras.places())
      return InvalidArgument("{} has {}, but {} has {}", anno_file.string(),
                             Count(images.places(), "picture"), sfm_file.string(),
                             Count(cameras.places(), "camera"));
    for (std::size_t i = 0; i < images.places(); ++i) {
      const Status read = ReadOne(images, cameras, i, split);
      if (!read.ok() && broken_ == nullptr) return read;
      if (!read.ok())
        broken_->Add(fmt::format("{}({})", anno_file.filename().string(), i + 1), read.message());
    }
    if (split == Split::kTrain) TILEGRAD_TRY(ReadMeanShape(sfm));
    return {};
  }

  Status ReadOne(const MatPlace& images, const MatPlace& cameras, std::size_t i, Split split) {
    Photograph photo;
    photo.split = split;
    TILEGRAD_ASSIGN(const MatPlace path, images.Field(i, "rel_path"));
    TILEGRAD_ASSIGN(photo.id, path.Text());
    const Path relative = Path(photo.id).lexically_normal();
    if (relative.is_absolute() || *relative.begin() == "..")
      return InvalidArgument("{}: \"{}\" is outside of the folder of pictures", path.where(),
                             photo.id);
    photo.image = layout_.images / relative;
    TILEGRAD_ASSIGN(const MatPlace box, images.Field(i, "bbox"));
    TILEGRAD_ASSIGN(photo.box, ReadBox(box));
    TILEGRAD_ASSIGN(const MatPlace parts, images.Field(i, "parts"));
    TILEGRAD_ASSIGN(photo.keypoints, ReadKeypoints(parts, set_.keypoint_names.size()));
    TILEGRAD_ASSIGN(const MatPlace mask, images.Field(i, "mask"));
    TILEGRAD_ASSIGN(photo.mask, ReadMask(mask));
    TILEGRAD_ASSIGN(photo.camera, ReadCamera(cameras, i));
    if (cameras.HasField("points")) {
      TILEGRAD_ASSIGN(const MatPlace points, cameras.Field(i, "points"));
      TILEGRAD_ASSIGN(photo.points, ReadPlaces(points));
    }
    set_.photographs.push_back(std::move(photo));
    return {};
  }

  Status ReadMeanShape(const io::MatFile& sfm) {
    TILEGRAD_ASSIGN(const MatPlace shape, MatPlace::Variable(sfm, "S"));
    TILEGRAD_ASSIGN(set_.mean_keypoints, ReadPlaces(shape));
    return {};
  }

  // 3 x K.
  Result<std::vector<std::array<double, 3>>> ReadPlaces(const MatPlace& places) const {
    const std::size_t count = set_.keypoint_names.size();
    TILEGRAD_TRY(places.ExpectSize(3, count));
    TILEGRAD_ASSIGN(const auto s, places.Numbers(3 * count));
    std::vector<std::array<double, 3>> out;
    for (std::size_t k = 0; k < count; ++k) out.push_back({s[3 * k], s[3 * k + 1], s[3 * k + 2]});
    return out;
  }

  Layout layout_;
  BrokenMembers* broken_;  // null: broken photographs are errors
  PhotographSet set_;
};

}  // namespace

Result<std::optional<PhotographSet>> OpenCmrLayout(const Path& folder, BrokenMembers* broken) {
  std::optional<Layout> layout = FindCub(folder);
  if (!layout) layout = FindPascal(folder);
  if (!layout) return std::optional<PhotographSet>();
  TILEGRAD_ASSIGN(PhotographSet set, CmrReader(std::move(*layout), broken).Read(folder));
  return std::optional(std::move(set));
}

}  // namespace tilegrad::train
