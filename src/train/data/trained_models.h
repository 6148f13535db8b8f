// SPDX-License-Identifier: Apache-2.0
// Which models a run was trained on, in its folder: a dataset can be split anew or made again under
// the same name, and then neither goes a run on with it, nor are its test models held out.
//
//   <run>/training_models.txt    a line "recipe <hex>", then one "<geometry> <class>/<id>" for each
//                                model, as the dataset lists them, a line "camera ..." and one
//                                "file <fingerprint> <class>/<id>" for each model
#pragma once

#include "base/file.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// Writes the list of a new run, whose `first_step` is 0; compares with that of a run that goes on:
// InvalidArgument names the first model, camera or file that differs. A run of an earlier version
// has no list, or none of cameras and files, and gets one.
Status RememberTrainedModels(const Path& run, const Dataset& dataset, std::int64_t first_step);

// InvalidArgument if the run was trained on models of the dataset's `split`, or on other colours of
// their meshes. Fine for a run without a list. `run`: as of ReadRunFile.
Status CheckHeldOut(const Path& run, const Dataset& dataset, Split split = Split::kTest);

}  // namespace tilegrad::train
