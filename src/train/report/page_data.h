// SPDX-License-Identifier: Apache-2.0
// What the page's script draws: curves and meshes, as JSON (report.js reads it).
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "scene/mesh.h"
#include "train/report/sections.h"

namespace tilegrad::train {

// {"low": [3], "high": [3], "positions", "colors", "faces": base64, "texture"}: positions as 16
// bits an axis over the bounding box, colours as 8 bits a channel (white where the mesh has none),
// indices of `index_bytes` bytes; all little-endian. `texture`, where all faces share one:
// {"image": address, "wrap": [2], "low": [2], "high": [2], "uvs": base64}, 16 bits a coordinate of
// a corner; else null. Null for a mesh without faces.
nlohmann::ordered_json MeshJson(const Mesh& mesh);
// The same in the middle of a cube of side 0.9. An error for a mesh without extent.
Result<nlohmann::ordered_json> CentredMeshJson(Mesh mesh);

// At most `count` entries: means over equal stretches, at the step of each stretch's last entry.
std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count);

// {"curves": {"step": [], "loss": [], ...}, "charts": [{"key", "title"}]}: a chart for each value
// of the log but the clock's.
nlohmann::ordered_json CurveData(const std::vector<LogEntry>& log, const TermLabels& labels);

// The same, with {"camera": {...}, "generated", "models": [...]}.
nlohmann::ordered_json PageData(const ReportFacts& facts);

}  // namespace tilegrad::train
