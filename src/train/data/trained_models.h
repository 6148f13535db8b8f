// SPDX-License-Identifier: Apache-2.0
// Records in the run folder which models or photographs a run was trained on: with a dataset that
// was split or built again, the run cannot be resumed, nor are its test models held out.
//
//   <run>/training_models.txt    a line "recipe <hex>", then one "<geometry> <class>/<id>" for each
//                                model, as the dataset lists them, a line "camera ..." and one
//                                "file <fingerprint> <class>/<id>" for each model
//   <run>/training_photographs.txt    a line "<id>" for each photograph, then one
//                                     "file <fingerprint> <id>", which covers its annotations
#pragma once

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// Writes the list of a new run (`first_step` 0); compares with that of a resumed run:
// InvalidArgument names the first model, camera or file that differs. A run of an earlier version
// without a list, or without cameras and files in it, gets one.
Status RememberTrainedModels(const Path& run, const Dataset& dataset, std::int64_t first_step);
Status RememberPhotographs(const Path& run, const PhotographSet& set, std::int64_t first_step,
                           const Workers& workers);

// Whether the run was trained on the training models or photographs of `data`, whatever their
// contents; true for a run without a list. `run`: as for ReadRunFile.
Result<bool> IsTrainedOn(const Path& run, const Path& data);

// InvalidArgument if the run was trained on models of the dataset's `split`, or on other colours of
// their meshes. OK for a run without a list. `run`: as for ReadRunFile.
Status CheckHeldOut(const Path& run, const Dataset& dataset, Split split = Split::kTest);
Status CheckHeldOutPhotographs(const Path& run, const PhotographSet& set, Split split);

// Whether the run has a list; runs on photographs have one of these.
Result<bool> HasTrainedList(const Path& run);

// Tells `warn` of a run without a list, for which CheckHeldOut cannot tell.
Status WarnWithoutList(const Path& run, const WarningSink& warn);

}  // namespace tilegrad::train
