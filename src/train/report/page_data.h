// SPDX-License-Identifier: Apache-2.0
// What the page's script draws: curves and meshes, as JSON (report.js reads it).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>

#include "train/report/run_facts.h"
#include "train/report/shown_models.h"

namespace tilegrad::train {

// {"low": [3], "high": [3], "positions", "colors", "faces": base64}: positions as 16 bits an axis
// over the bounding box, colours as 8 bits a channel (white where the mesh has none), indices of
// `index_bytes` bytes; all little-endian. An error never grows from a mesh that is valid.
nlohmann::ordered_json MeshJson(const Mesh& mesh);

// {"curves": {"step": [], "loss": [], ...}, "camera": {...}, "models": [...]}.
nlohmann::ordered_json PageData(const RunFacts& run, const Dataset& dataset,
                                std::span<const ShownModel> models);

}  // namespace tilegrad::train
