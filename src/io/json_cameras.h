// SPDX-License-Identifier: Apache-2.0
// Internal to io: the text of a JSON file of cameras.
#pragma once

#include <string>
#include <vector>

#include "io/camera_file.h"

namespace tilegrad::io {

// As LoadCameras of a file. `file` stands in messages.
Result<std::vector<CameraView>> ReadJsonCameras(const std::string& text, const Path& file,
                                                const CameraFileOptions& options);

}  // namespace tilegrad::io
