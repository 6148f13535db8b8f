// SPDX-License-Identifier: Apache-2.0
// Internal to io: the only place where Assimp runs. Its importers crash, hang and take memory
// without end on damaged files, so this is called in a process of its own (guarded_process.h).
#pragma once

#include <string>

#include "io/guarded_process.h"
#include "io/imported_scene.h"

namespace tilegrad::io {

// Questions that an importer has about other files (MTL, ...): one of these and the name.
inline constexpr char kAskExists = 'E', kAskContent = 'C';

// Never frees what it made: the process ends next.
Result<ImportedScene> ImportByAssimp(const std::string& name, const Bytes& file, AskParent ask);

}  // namespace tilegrad::io
