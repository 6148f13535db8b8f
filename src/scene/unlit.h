// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "scene/mesh.h"

namespace tilegrad {

// The colours hold their light already, as those that were learned from images do: materials become
// unlit, so that no viewer shades them again. A mesh without materials gets a white one, `name`.
void SetUnlit(Mesh& mesh, const std::string& name);

}  // namespace tilegrad
