// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace tilegrad::train {

// The text of data/sweethome3d_classes.tsv (columns: docs/datasets.md).
std::string_view SweetHome3dList();

}  // namespace tilegrad::train
