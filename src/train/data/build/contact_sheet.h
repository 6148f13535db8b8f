// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "train/data/dataset.h"

namespace tilegrad::train {

// Writes <folder>/contact_sheet.png: a row for each class, up to six of its models (the first in
// the order of models.jsonl, spread over it), each from three views, over light grey.
Status WriteContactSheet(const Dataset& dataset);

}  // namespace tilegrad::train
