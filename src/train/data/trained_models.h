// SPDX-License-Identifier: Apache-2.0
// Records in the run folder which models a run was trained on: with a dataset that was split or
// built again, the run cannot be resumed, nor are its test models held out.
//
//   <run>/training_models.txt    a line "recipe <hex>", then one "<geometry> <class>/<id>" for each
//                                model, as the dataset lists them, a line "camera ..." and one
//                                "file <fingerprint> <class>/<id>" for each model
#pragma once

#include "base/file.h"
#include "base/progress.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// Writes the list of a new run (`first_step` 0); compares with that of a resumed run:
// InvalidArgument names the first model, camera or file that differs. A run of an earlier version
// without a list, or without cameras and files in it, gets one.
Status RememberTrainedModels(const Path& run, const Dataset& dataset, std::int64_t first_step);

// InvalidArgument if the run was trained on models of the dataset's `split`, or on other colours of
// their meshes. OK for a run without a list. `run`: as for ReadRunFile.
Status CheckHeldOut(const Path& run, const Dataset& dataset, Split split = Split::kTest);

// Whether the run has a list; runs on photographs have one of these.
Result<bool> HasTrainedList(const Path& run);

// Tells `warn` of a run without a list, for which CheckHeldOut cannot tell.
Status WarnWithoutList(const Path& run, const WarningSink& warn);

}  // namespace tilegrad::train
