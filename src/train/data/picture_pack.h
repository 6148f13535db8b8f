// SPDX-License-Identifier: Apache-2.0
// All pictures of a dataset, unpacked, in one file that training maps: they may exceed memory, and
// unpacking them at each start takes minutes.
//
//   <dataset>/pictures.bin   [models][views][4][size][size] bytes in the order of models.jsonl,
//                            then a line with the format and a checksum over the model files
//
// Where that line does not match the model files, the next training rewrites it.
#pragma once

#include <optional>
#include <vector>

#include "base/aligned.h"
#include "base/function_ref.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// Calls take(i, the images of models[i]), from any thread. Errors: kCancelled; those of a model
// file, which they name; those of `take`.
Status UnpackPictures(const Dataset& dataset, const std::vector<int>& models,
                      const Workers& workers, const Watch& watch,
                      FunctionRef<Status(std::size_t, std::span<const std::uint8_t>)> take);

// Maps the file's pictures; writes it first if it is missing or does not match the model files. One
// process writes at a time, and the others wait. nullopt if the folder is not writable or the disk
// too full. Errors: as above.
Result<std::optional<ScratchBytes>> OpenPicturePack(const Dataset& dataset, const Workers& workers,
                                                    const Watch& watch);

}  // namespace tilegrad::train
