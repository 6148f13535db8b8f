// SPDX-License-Identifier: Apache-2.0
// PASCAL3D+ (release 1.1), as unpacked, with its own annotations:
//
//   Annotations/<class>_<imagenet|pascal>/*.mat    pascal3d_record.h
//   Images/<class>_<imagenet|pascal>/
//   Image_sets/<class>_imagenet_<train|val>.txt    the training and the test split
//   CAD/<class>.mat                                for masks, if nothing better exists
//   PASCAL/VOCdevkit/VOC2012/ImageSets/Main/<train|val>.txt, SegmentationObject/
//
// in the folder itself or in PASCAL3D+_release1.1 of it.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "render/picture/picture.h"
#include "scene/mesh.h"
#include "train/data/broken_members.h"
#include "train/data/photographs/collect.h"
#include "train/data/photographs/pascal3d_record.h"

namespace tilegrad::train {

// The folder that has Annotations/.
std::optional<Path> Pascal3dRoot(const Path& input);

// Objects of the class that are neither truncated, occluded nor difficult, and have a fine
// viewpoint and a mask. Pictures go to `images`. Keypoints: the anchors, by name. Cameras: the weak
// perspective whose projection of the mean keypoints is nearest to the annotated pinhole camera's;
// mean keypoints: triangulated from the training part's cameras, made symmetric.
Result<PhotographSet> ReadPascal3d(const CollectionJob& job, const Path& images,
                                   const MemberWork& work, CollectionSummary* summary);

// Masks of PASCAL3D+'s objects, which the set itself lacks.

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

// CAD/<class>.mat in the project's world (CameraOfViewpoint). Empty without such a file; a broken
// model has no faces.
Result<std::vector<Mesh>> ReadCadModels(const Path& root, const std::string& class_name,
                                        BrokenMembers* broken);

struct MaskRequest {
  const Pascal3dObject& object;
  std::string id;  // of the picture: <class>_<part>/<file>
  bool alone;      // the only object of the class in the picture
  ImageSize size;
};

// Used by one thread at a time.
class Pascal3dMasks {
 public:
  Pascal3dMasks(const Path& root, const Path& masks, const std::vector<Mesh>& cad);
  // Returns the origin; kNone, with `mask` empty, if there is no mask or nothing in it. Errors name
  // the file.
  Result<MaskOrigin> Find(const MaskRequest& request, PhotoMask* mask);

 private:
  Result<bool> FromImage(const Path& file, const MaskRequest& request, bool voc, PhotoMask* mask);
  Status FromCad(const MaskRequest& request, PhotoMask* mask);

  Path root_, masks_;
  const std::vector<Mesh>& cad_;
  Workers alone_;
  PictureRenderer renderer_;
};

}  // namespace tilegrad::train
