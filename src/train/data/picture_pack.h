// SPDX-License-Identifier: Apache-2.0
// All pictures of a dataset, unpacked, in one file that trainings map: more than the memory holds,
// and minutes to unpack at each start.
//
//   <dataset>/pictures.bin   [models][views][4][size][size] bytes in the order of models.jsonl,
//                            then a line with the format and a checksum over the model files
//
// It stands for the model files as long as that line does; the next training writes another.
#pragma once

#include <optional>
#include <vector>

#include "base/aligned.h"
#include "base/function_ref.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// take(i, the images of models[i]), from any thread. Errors: kCancelled; of a
// model file, which is named; of `take`.
Status UnpackPictures(const Dataset& dataset, const std::vector<int>& models,
                      const Workers& workers, const Watch& watch,
                      FunctionRef<Status(std::size_t, std::span<const std::uint8_t>)> take);

// The file's pictures, mapped; it is written first if it is missing, or of other model files. One
// process writes at a time, and the others wait for it. Nothing where the folder may not be written
// to, or the disk is too full. Errors: as above.
Result<std::optional<ScratchBytes>> OpenPicturePack(const Dataset& dataset, const Workers& workers,
                                                    const Watch& watch);

}  // namespace tilegrad::train
