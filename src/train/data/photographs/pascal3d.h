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

#include "train/data/photographs/collect.h"

namespace tilegrad::train {

// Objects of the class that are neither truncated, occluded nor difficult, and have a fine
// viewpoint and a mask. Pictures go to `images`. Keypoints: the anchors, by name. Cameras: the weak
// perspective whose projection of the mean keypoints is nearest to the annotated pinhole camera's;
// mean keypoints: triangulated from the training part's cameras, made symmetric.
Result<PhotographSet> ReadPascal3d(const CollectionJob& job, const Path& images,
                                   const MemberWork& work, CollectionSummary* summary);

}  // namespace tilegrad::train
