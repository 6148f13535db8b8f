// SPDX-License-Identifier: Apache-2.0
// PASCAL3D+ (release 1.1) by its own annotations, as it is unpacked:
//
//   Annotations/<class>_<imagenet|pascal>/*.mat    pascal3d_record.h
//   Images/<class>_<imagenet|pascal>/
//   Image_sets/<class>_imagenet_<train|val>.txt    what is trained on and what is tested on
//   CAD/<class>.mat                                masks, where nothing better is there
//   PASCAL/VOCdevkit/VOC2012/ImageSets/Main/<train|val>.txt, SegmentationObject/
//
// in the folder itself or in PASCAL3D+_release1.1 of it.
#pragma once

#include <optional>

#include "train/data/photographs/collect.h"
#include "train/data/photographs/members.h"

namespace tilegrad::train {

// The folder that has Annotations/.
std::optional<Path> Pascal3dRoot(const Path& input);

// Objects of the class that are neither truncated, occluded nor difficult, and have a fine
// viewpoint and a mask. Pictures go to `images`. Keypoints: the anchors, by name. Cameras: the weak
// perspective that sees the mean keypoints nearest to where the annotated pinhole camera does; mean
// keypoints: the points that the training part's cameras see at theirs, made symmetric.
Result<PhotographSet> ReadPascal3d(const CollectionJob& job, const Path& images,
                                   const MemberWork& work, CollectionSummary* summary);

}  // namespace tilegrad::train
