// SPDX-License-Identifier: Apache-2.0
// CUB-200 and PASCAL3D+ as their users have them, made into a folder that training reads: pictures
// that can be read, and annotations as CMR lays them out (photographs.h).
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/function_ref.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "scene/camera.h"
#include "train/data/broken_members.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

struct CollectionJob {
  std::string source;  // "cub" or "pascal3d"
  Path input;
  std::string class_name = "car";  // of PASCAL3D+
  Path masks = {};                 // of PASCAL3D+ (pascal3d.h); empty: none
  bool allow_broken = false;       // more than BrokenMembers does
};

struct CollectionSummary {
  std::array<int, 3> photographs = {};  // by Split
  std::map<std::string, int> notes;     // what was left out and where masks come from: how many
  BrokenMembers broken;
};

// Of pictures, boxes, keypoints, masks and cameras: CMR's files where the input has them and no
// masks are given, else PASCAL3D+'s own annotations (pascal3d.h). A picture or annotation that
// cannot be read costs itself. Pictures are copied, those of an earlier call kept. The same bytes
// for any number of workers. Errors: neither form is there, nothing to train on, too many are
// broken.
Result<CollectionSummary> CollectPhotographs(const CollectionJob& job, const Path& folder,
                                             const Workers& workers, const ProgressSink& progress,
                                             const StopFlag& stop);

// The members of a set of photographs, one after the other: files of annotations or of pictures.

struct MemberWork {
  const Workers& workers;
  const ProgressSink& progress;
  const StopFlag& stop;
};

// take(index, worker) for each name; those that fail are broken, in their order. Errors: stopped,
// or the system refused resources, which says nothing of a member.
Status TakeMembers(const std::vector<std::string>& names, const MemberWork& work,
                   FunctionRef<Status(std::size_t, std::size_t)> take, BrokenMembers* broken);

// Reads a picture to its end and copies its file. Its size, as stored.
Result<ImageSize> TakePicture(const Path& from, const Path& to);

}  // namespace tilegrad::train
