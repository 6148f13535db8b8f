// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/pascal3d.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>

#include "base/error.h"
#include "io/image_file.h"
#include "render/picture/mesh_scene.h"
#include "render/picture/picture.h"
#include "scene/mesh.h"
#include "scene/weak_perspective.h"
#include "train/data/photographs/factorization.h"
#include "train/data/photographs/pascal3d_record.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

using Color = std::array<std::uint8_t, 3>;

// PASCAL VOC's palette: bits of the index go to red, green and blue in turn, the lowest first.
Color VocColor(int index) {
  Color out = {};
  for (int bit = 7; index > 0; --bit, index >>= 3) {
    for (int c = 0; c < 3; ++c)
      out[c] = static_cast<std::uint8_t>(out[c] | ((index >> c) & 1) << bit);
  }
  return out;
}

bool IsEmpty(const PhotoMask& mask) {
  return std::ranges::find(mask.inside, true) == mask.inside.end();
}

// Faces are triangles, whose corners count from 1.
Result<Mesh> ReadCadModel(const io::MatPlace& models, std::size_t index) {
  TILEGRAD_ASSIGN(const io::MatPlace vertices, models.Field(index, "vertices"));
  TILEGRAD_ASSIGN(const io::MatPlace faces, models.Field(index, "faces"));
  const std::size_t points = vertices.array().dims[0], triangles = faces.array().dims[0];
  TILEGRAD_TRY(vertices.ExpectSize(points, 3));
  TILEGRAD_TRY(faces.ExpectSize(triangles, 3));
  TILEGRAD_ASSIGN(const auto v, vertices.Numbers(3 * points));
  TILEGRAD_ASSIGN(const auto f, faces.Numbers(3 * triangles));
  Mesh out;
  for (std::size_t i = 0; i < points; ++i)
    out.positions.push_back({static_cast<float>(v[i]), static_cast<float>(v[2 * points + i]),
                             static_cast<float>(-v[points + i])});
  if (!std::ranges::all_of(f,
                           [&](double corner) { return corner >= 1 && corner <= double(points); }))
    return InvalidArgument("{}: corners beyond its {} vertices", faces.where(), points);
  for (std::size_t i = 0; i < triangles; ++i)
    out.faces.push_back({static_cast<std::int32_t>(f[i]) - 1,
                         static_cast<std::int32_t>(f[triangles + i]) - 1,
                         static_cast<std::int32_t>(f[2 * triangles + i]) - 1});
  if (out.faces.empty()) return InvalidArgument("{}: no triangles in it", faces.where());
  TILEGRAD_TRY(Validate(out).Within(faces.where()));
  return out;
}

// CAD/<class>.mat in the project's world (CameraOfViewpoint). Empty without such a file; a broken
// model has no faces.
Result<std::vector<Mesh>> ReadCadModels(const Path& root, const std::string& class_name,
                                        BrokenMembers* broken) {
  std::vector<Mesh> out;
  const Path file = root / "CAD" / (class_name + ".mat");
  if (!PathExists(file)) return out;
  TILEGRAD_ASSIGN(const io::MatFile mat, io::LoadMat(file));
  TILEGRAD_ASSIGN(const io::MatPlace models, io::MatPlace::Variable(mat, class_name));
  TILEGRAD_TRY(models.ExpectStruct());
  for (std::size_t i = 0; i < models.places(); ++i) {
    auto mesh = ReadCadModel(models, i);
    if (!mesh.ok())
      broken->Add(fmt::format("CAD/{}.mat({})", class_name, i + 1), mesh.status().message());
    out.push_back(mesh.ok() ? std::move(*mesh) : Mesh());
  }
  return out;
}

// Where a mask comes from; the first that exists is used.
enum class MaskOrigin {
  kFolder,  // the user's: <masks>/<class>_<part>/<picture>.png, or <picture>_<number>.png of one
            // object among several, white where it is
  kVoc,     // PASCAL/VOCdevkit/VOC2012/SegmentationObject; its void edges count as outside
  kCad,     // the silhouette of the CAD model that is most like it, seen from the viewpoint
  kNone
};
inline constexpr std::array<const char*, 4> kMaskOrigins = {
    "of the masks folder", "of PASCAL VOC", "drawn from CAD models", "without a mask"};

struct MaskRequest {
  const Pascal3dObject& object;
  std::string id;  // of the picture: <class>_<part>/<file>
  bool alone;      // the only object of the class in the picture
  ImageSize size;
};

// Masks of PASCAL3D+'s objects, which the set itself lacks. Used by one thread at a time.
class Pascal3dMasks {
 public:
  Pascal3dMasks(const Path& root, const Path& masks, const std::vector<Mesh>& cad)
      : root_(root), masks_(masks), cad_(cad), alone_(1), renderer_(alone_) {}

  // Returns the origin; kNone, with `mask` empty, if there is no mask or nothing in it. Errors name
  // the file.
  Result<MaskOrigin> Find(const MaskRequest& request, PhotoMask* mask) {
    const std::string stem = Path(request.id).stem().string();
    if (!masks_.empty()) {
      const Path folder = masks_ / Path(request.id).parent_path();
      const Path own = folder / fmt::format("{}_{}.png", stem, request.object.number);
      TILEGRAD_ASSIGN(bool found, FromImage(own, request, false, mask));
      if (!found && request.alone) {
        TILEGRAD_ASSIGN(found, FromImage(folder / (stem + ".png"), request, false, mask));
      }
      if (found) return MaskOrigin::kFolder;
    }
    const Path voc = root_ / "PASCAL/VOCdevkit/VOC2012/SegmentationObject" / (stem + ".png");
    TILEGRAD_ASSIGN(const bool found, FromImage(voc, request, true, mask));
    if (found) return MaskOrigin::kVoc;
    const int cad = request.object.cad;
    const bool whole = cad >= 1 && cad <= std::ssize(cad_) &&
                       !cad_[static_cast<std::size_t>(cad) - 1].faces.empty();
    if (!whole) return MaskOrigin::kNone;
    TILEGRAD_TRY(FromCad(request, mask));
    return IsEmpty(*mask) ? MaskOrigin::kNone : MaskOrigin::kCad;
  }

 private:
  Result<bool> FromImage(const Path& file, const MaskRequest& request, bool voc, PhotoMask* mask) {
    if (!PathExists(file)) return false;
    TILEGRAD_ASSIGN(ImageU8 read, io::LoadImage(file));
    const ImageU8 image = io::ToColor(std::move(read));
    const auto [width, height] = request.size;
    if (image.width != width || image.height != height)
      return InvalidArgument("{}: {} x {} pixels, but its picture has {} x {}", file.string(),
                             image.width, image.height, width, height);
    *mask = {width, height, {}};
    const Color color = VocColor(request.object.number);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::uint8_t* const at = image.at(x, y);
        mask->inside.push_back(voc ? std::equal(color.begin(), color.end(), at) : at[0] >= 128);
      }
    }
    return !IsEmpty(*mask);
  }

  Status FromCad(const MaskRequest& request, PhotoMask* mask) {
    const Mesh& mesh = cad_[static_cast<std::size_t>(request.object.cad) - 1];
    MeshSceneOptions options;
    options.blend = false;
    const MeshScene made(mesh, options);
    Scene scene = made.scene();
    scene.camera = CameraCast<float>(CameraOfViewpoint(request.object.viewpoint));
    const auto [width, height] = request.size;
    Picture seen;
    TILEGRAD_TRY(renderer_.Render(
        scene, {.width = width, .height = height, .color = false, .depth = true}, &seen));
    *mask = {width, height, {}};
    for (const float depth : seen.depth) mask->inside.push_back(std::isfinite(depth));
    return {};
  }

  Path root_, masks_;
  const std::vector<Mesh>& cad_;
  Workers alone_;
  PictureRenderer renderer_;
};

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

// The folder that has Annotations/.
std::optional<Path> Pascal3dRoot(const Path& input) {
  for (const Path& root : {input, input / "PASCAL3D+_release1.1"}) {
    if (IsFolder(root / "Annotations")) return root;
  }
  return std::nullopt;
}

}  // namespace

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
