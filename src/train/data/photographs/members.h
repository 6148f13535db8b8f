// SPDX-License-Identifier: Apache-2.0
// The members of a set of photographs, one after the other: files of annotations or of pictures.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "base/function_ref.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "scene/camera.h"
#include "train/data/broken_members.h"

namespace tilegrad::train {

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
