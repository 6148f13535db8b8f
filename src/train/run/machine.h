// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace tilegrad::train {

// What a result depends on besides configuration and data, as name and value: version, compiler,
// CPU, cores, SIMD target.
std::vector<std::pair<std::string, std::string>> DescribeMachine();

}  // namespace tilegrad::train
