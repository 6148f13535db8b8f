// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/pascal3d.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>

#include "base/error.h"
#include "scene/weak_perspective.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/pascal3d_masks.h"
#include "train/data/photographs/pascal3d_record.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

using Places = std::vector<std::array<double, 3>>;

struct AnnotatedPhoto {
  Photograph photo;
  Pascal3dObject object;
};

struct AnnotationFile {
  Path path;
  std::string folder;  // <class>_<part>
  Split split;
};

// "left_front_light" <-> "right_front_light"; else the name itself.
std::string MirrorName(const std::string& name) {
  for (const auto& [from, to] : {std::pair("left", "right"), {"right", "left"}}) {
    const auto at = name.find(from);
    if (at != std::string::npos) return std::string(name).replace(at, std::string(from).size(), to);
  }
  return name;
}

// Names of pictures; what follows a name in its line is not read. Nothing of a file that is
// missing.
Status ReadSplitList(const Path& file, Split split, std::map<std::string, Split>* out) {
  if (!PathExists(file)) return {};
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::istringstream lines(text);
  std::string name;
  for (std::string line; std::getline(lines, line);) {
    if (std::istringstream(line) >> name) out->emplace(name, split);
  }
  return {};
}

class Pascal3dReader {
 public:
  Pascal3dReader(const CollectionJob& job, Path root, Path images, CollectionSummary* summary)
      : job_(job), root_(std::move(root)), images_(std::move(images)), summary_(summary) {}

  Result<std::vector<AnnotatedPhoto>> Read(const MemberWork& work) {
    for (const char* part : {"imagenet", "pascal"}) TILEGRAD_TRY(List(part));
    TILEGRAD_ASSIGN(cad_, ReadCadModels(root_, job_.class_name, &summary_->broken));
    for (int w = 0; w < work.workers.count(); ++w)
      masks_.push_back(std::make_unique<Pascal3dMasks>(root_, job_.masks, cad_));
    std::vector<std::string> names;
    for (const AnnotationFile& file : files_)
      names.push_back(file.folder + "/" + file.path.filename().string());
    std::vector<std::vector<AnnotatedPhoto>> found(files_.size());
    TILEGRAD_TRY(TakeMembers(
        names, work,
        [&](std::size_t i, std::size_t worker) { return ReadOne(i, worker, &found[i]); },
        &summary_->broken));
    TILEGRAD_TRY(summary_->broken.Check(files_.size() + cad_.size(), job_.allow_broken));
    std::vector<AnnotatedPhoto> out;
    for (auto& some : found) std::ranges::move(some, std::back_inserter(out));
    return out;
  }

 private:
  Status List(const std::string& part) {
    const std::string folder = job_.class_name + "_" + part;
    if (!IsFolder(root_ / "Annotations" / folder)) return {};
    std::map<std::string, Split> splits;
    for (const auto& [name, split] : {std::pair("train", Split::kTrain), {"val", Split::kTest}}) {
      const Path file =
          part == "imagenet"
              ? root_ / "Image_sets" / fmt::format("{}_{}.txt", folder, name)
              : root_ / "PASCAL/VOCdevkit/VOC2012/ImageSets/Main" / fmt::format("{}.txt", name);
      TILEGRAD_TRY(ReadSplitList(file, split, &splits));
    }
    TILEGRAD_ASSIGN(const auto files, ListFolder(root_ / "Annotations" / folder));
    for (const Path& path : files) {
      if (path.extension() != ".mat") continue;
      const auto split = splits.find(path.stem().string());
      if (split == splits.end()) {
        Note("annotations in no list of " + part);
        continue;
      }
      files_.push_back({path, folder, split->second});
    }
    return {};
  }

  void Note(const std::string& what) {
    const std::scoped_lock lock(mutex_);
    ++summary_->notes[what];
  }

  bool IsUsable(const Pascal3dObject& object) {
    if (!object.whole) Note("objects truncated, occluded or difficult");
    if (object.whole && !(object.viewpoint.distance > 0)) Note("objects without a fine viewpoint");
    return object.whole && object.viewpoint.distance > 0;
  }

  Status ReadOne(std::size_t i, std::size_t worker, std::vector<AnnotatedPhoto>* out) {
    const AnnotationFile& file = files_[i];
    TILEGRAD_ASSIGN(const io::MatFile mat, io::LoadMat(file.path));
    TILEGRAD_ASSIGN(auto record, ReadPascal3dRecord(mat, job_.class_name));
    const bool alone = record.objects.size() == 1;
    std::erase_if(record.objects, [&](const auto& object) { return !IsUsable(object); });
    if (record.objects.empty()) return {};
    const std::string id = file.folder + "/" + record.file;
    TILEGRAD_ASSIGN(const ImageSize size, TakePicture(root_ / "Images" / id, images_ / id));
    for (Pascal3dObject& object : record.objects) {
      AnnotatedPhoto made;
      made.photo.id = id;
      made.photo.split = file.split;
      made.photo.box = object.box;
      TILEGRAD_ASSIGN(const MaskOrigin origin,
                      masks_[worker]->Find({object, id, alone, size}, &made.photo.mask));
      Note(std::string("objects ") + kMaskOrigins[static_cast<std::size_t>(origin)]);
      TILEGRAD_ASSIGN(made.photo.camera,
                      WeakPerspectiveOf(CameraOfViewpoint(object.viewpoint), {0, 0, 0}));
      TILEGRAD_TRY(CheckPhotograph(made.photo));
      made.object = std::move(object);
      if (origin != MaskOrigin::kNone) out->push_back(std::move(made));
    }
    return {};
  }

  const CollectionJob& job_;
  const Path root_, images_;
  CollectionSummary* const summary_;
  std::vector<AnnotationFile> files_;
  std::vector<Mesh> cad_;
  std::vector<std::unique_ptr<Pascal3dMasks>> masks_;  // one a worker
  std::mutex mutex_;
};

void SetKeypoints(std::vector<AnnotatedPhoto>* photos, PhotographSet* set) {
  std::set<std::string> names;
  for (const AnnotatedPhoto& made : *photos) {
    for (const auto& [name, keypoint] : made.object.anchors) names.insert(name);
  }
  set->keypoint_names.assign(names.begin(), names.end());
  for (const std::string& name : names) {
    auto other = names.find(MirrorName(name));
    if (other == names.end()) other = names.find(name);
    set->mirror.push_back(static_cast<int>(std::distance(names.begin(), other)));
  }
  for (AnnotatedPhoto& made : *photos) {
    for (const std::string& name : names) made.photo.keypoints.push_back(made.object.anchors[name]);
  }
}

Places MeanKeypoints(const std::vector<AnnotatedPhoto>& photos, const std::vector<int>& mirror) {
  std::vector<std::vector<Keypoint>> views;
  std::vector<WeakPerspective> cameras;
  for (const AnnotatedPhoto& made : photos) {
    if (made.photo.split != Split::kTrain) continue;
    views.push_back(made.photo.keypoints);
    cameras.push_back(*made.photo.camera);
  }
  const Places found = LocateKeypoints(views, cameras);
  Places out;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const auto &p = found[k], &m = found[static_cast<std::size_t>(mirror[k])];
    out.push_back({(p[0] - m[0]) / 2, (p[1] + m[1]) / 2, (p[2] + m[2]) / 2});
  }
  return out;
}

// 2 divided by it makes the largest distance 2, as the world of photographs has it.
double LargestDistanceOf(const Places& places) {
  double largest = 0;
  for (const auto& a : places) {
    for (const auto& b : places)
      largest = std::max(largest, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]));
  }
  return largest;
}

std::vector<Keypoint> SeenBy(const Camera64& c, const Places& places) {
  std::vector<Keypoint> out;
  for (const auto& p : places) {
    double q[3];
    for (int r = 0; r < 3; ++r)
      q[r] = c.rotation[3 * r] * p[0] + c.rotation[3 * r + 1] * p[1] +
             c.rotation[3 * r + 2] * p[2] + c.translation[r];
    out.push_back({c.cx + c.fx * q[0] / -q[2], c.cy - c.fy * q[1] / -q[2], q[2] < 0});
  }
  return out;
}

void SetCameras(std::vector<AnnotatedPhoto>* photos, PhotographSet* set) {
  Places& mean = set->mean_keypoints;
  mean = MeanKeypoints(*photos, set->mirror);
  const double largest = LargestDistanceOf(mean), factor = largest > 1e-6 ? 2 / largest : 1;
  for (AnnotatedPhoto& made : *photos) {
    const auto seen = SeenBy(CameraOfViewpoint(made.object.viewpoint), mean);
    if (largest > 1e-6) made.photo.camera = FitWeakCamera(mean, seen, *made.photo.camera);
    made.photo.camera->scale /= factor;
  }
  for (auto& place : mean) {
    for (double& x : place) x *= factor;
  }
}

}  // namespace

std::optional<Path> Pascal3dRoot(const Path& input) {
  for (const Path& root : {input, input / "PASCAL3D+_release1.1"}) {
    if (IsFolder(root / "Annotations")) return root;
  }
  return std::nullopt;
}

Result<PhotographSet> ReadPascal3d(const CollectionJob& job, const Path& images,
                                   const MemberWork& work, CollectionSummary* summary) {
  const auto root = Pascal3dRoot(job.input);
  if (!root) return NotFound("{}: no Annotations of PASCAL3D+ in it", job.input.string());
  TILEGRAD_ASSIGN(auto photos, Pascal3dReader(job, *root, images, summary).Read(work));
  PhotographSet set;
  set.source = "pascal3d";
  set.class_name = job.class_name;
  SetKeypoints(&photos, &set);
  SetCameras(&photos, &set);
  for (AnnotatedPhoto& made : photos) set.photographs.push_back(std::move(made.photo));
  return set;
}

}  // namespace tilegrad::train
