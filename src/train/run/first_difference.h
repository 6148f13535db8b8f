// SPDX-License-Identifier: Apache-2.0
// Why a run cannot go on: what it was started with is kept as text, a line for each thing.
#pragma once

#include <string>

namespace tilegrad::train {

// The first line in which two such texts differ: was "rate = 1", is "rate = 2"; "" if they are
// equal. A line that one of them lacks is none.
std::string FirstDifference(const std::string& was, const std::string& is);

}  // namespace tilegrad::train
