// SPDX-License-Identifier: Apache-2.0
// Which models of a source a dataset gets.
#pragma once

#include <cstddef>
#include <vector>

#include "train/data/build/build.h"

namespace tilegrad::train {

// Entries by classes, per_class, liveries and limit; ascending. The first by hash, so that a part
// of a set is as varied as the whole: first of shapes, then of the models of each.
std::vector<std::size_t> ChooseEntries(const std::vector<SourceEntry>& entries,
                                       const BuildOptions& options);

// InvalidArgument names a class that no entry has.
Status CheckClasses(const std::vector<SourceEntry>& entries,
                    const std::vector<std::string>& classes);

// InvalidArgument names an option out of its range.
Status CheckOptions(const BuildOptions& options);

}  // namespace tilegrad::train
