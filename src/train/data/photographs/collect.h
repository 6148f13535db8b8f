// SPDX-License-Identifier: Apache-2.0
// Converts CUB-200 and PASCAL3D+, as users have them, to a folder that training reads: the readable
// pictures, with annotations in CMR's layout (photographs.h).
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
  bool allow_broken = false;       // beyond the limit of BrokenMembers
};

struct CollectionSummary {
  std::array<int, 3> photographs = {};  // by Split
  std::map<std::string, int> notes;     // counts of what was left out and of origins of masks
  BrokenMembers broken;
};

// Boxes, keypoints, masks and cameras come from CMR's files if the input has them and no masks are
// given, else from PASCAL3D+'s own annotations (pascal3d.h). Skips unreadable pictures and
// annotations. Copies pictures, but keeps those of an earlier call. The same bytes for any number
// of workers. Errors: neither form is there, nothing to train on, too many are broken.
Result<CollectionSummary> CollectPhotographs(const CollectionJob& job, const Path& folder,
                                             const Workers& workers, const Watch& watch);

// Processes the members of a set of photographs: files of annotations or of pictures.

struct MemberWork {
  const Workers& workers;
  const Watch& watch;
};

// Calls take(index, worker) for each name; adds those that fail to `broken`, in order. Errors:
// stopped, or the system refused resources, which is no fault of a member.
Status TakeMembers(const std::vector<std::string>& names, const MemberWork& work,
                   FunctionRef<Status(std::size_t, std::size_t)> take, BrokenMembers* broken);

// Decodes a whole picture and copies its file. Returns its size, as stored.
Result<ImageSize> TakePicture(const Path& from, const Path& to);

}  // namespace tilegrad::train
