// SPDX-License-Identifier: Apache-2.0
// What predict knows of a refined mesh beside its pictures: NAME_match.json.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/file.h"
#include "fit/refine.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

// {"silhouette_iou": [before, after], "color_l1": [before, after], "camera_doubtful": false}:
// PictureMatch of the prediction and of the refined mesh, and whether RefinedMesh::rival is near.
nlohmann::ordered_json ScoresOf(const train::RefinedMesh& refined);

// The same and "camera", which sees the refined mesh, in pixels of a picture of "size" pixels a
// side.
Status WriteMatch(const train::RefinedMesh& refined, const Path& file);

}  // namespace tilegrad::cli
