// SPDX-License-Identifier: Apache-2.0
// The report page of a run, and the JSON of curves and meshes that its script draws (report.js).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "scene/mesh.h"
#include "train/config.h"
#include "train/run/log.h"
#include "train/run/run_files.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

// The contents of a run's folder.
struct RunFacts {
  Path folder;
  RunHeader header;
  TrainConfig config;
  std::string config_text;  // config.toml verbatim
  std::vector<LogEntry> log;
};

// The contents of a report, gathered from the run and its task.
struct ReportFacts {
  RunFacts run;
  std::string data;       // the dataset's folder, as given
  std::string predictor;  // Predictor::description
  std::int64_t step = 0;  // of the checkpoint shown
  std::optional<Evaluation> evaluation;
  bool listed = false;  // what the run was trained on, so that nothing of that is shown as held out
  Showcase showcase;
};

// {"low": [3], "high": [3], "positions", "colors", "faces": base64, "texture"}: positions as 16
// bits an axis over the bounding box, colours as 8 bits a channel (white where the mesh has none),
// indices of `index_bytes` bytes; all little-endian. `texture`, if all faces share one: {"image":
// address, "wrap": [2], "low": [2], "high": [2], "uvs": base64}, 16 bits a coordinate of a corner;
// else null. Null for a mesh without faces.
nlohmann::ordered_json MeshJson(const Mesh& mesh);
// The same, centred in a cube of side 0.9. An error for a mesh without extent.
Result<nlohmann::ordered_json> CentredMeshJson(Mesh mesh);

// At most `count` entries: means over equal stretches, at the step of each stretch's last entry.
std::vector<LogEntry> Thin(const std::vector<LogEntry>& log, std::size_t count);

// {"curves": {"step": [], "loss": [], ...}, "charts": [{"key", "title"}]}: a chart for each logged
// value except the clock's.
nlohmann::ordered_json CurveData(const std::vector<LogEntry>& log, const TermLabels& labels);

// A self-contained page about a run: what was trained, how good it is, curves, pictures, meshes to
// turn, configuration, credits.
struct ReportJob {
  Path run;        // with at least one complete checkpoint
  Path data;       // dataset folder
  Path out;        // the page
  int models = 8;  // held-out models to show, >= 0
  // A PNG of all shown models, if the task has one; empty: not written.
  Path sheet = {};
};

struct ReportSummary {
  std::size_t bytes = 0;              // of the page
  int models = 0;                     // shown, or photographs
  std::string thing;                  // Showcase::thing, of which `models` are shown
  bool evaluated = false;             // the run has an eval.json
  std::string sheet_columns;          // of ReportJob::sheet, if it was written
  std::vector<std::string> warnings;  // newer checkpoints that could not be read
};

// Page and sheet appear whole or not at all, the page first. The same run and dataset give the
// same bytes. Errors name the file of the run or dataset that is missing or broken.
Result<ReportSummary> WriteReport(const ReportJob& job, const Workers& workers, const Watch& watch);

// The parts of the page as HTML (sections.cc); all text from files is escaped.
std::string SummaryHtml(const ReportFacts& facts);  // what was trained on what, and how good it is
std::string ComparisonHtml(const ReportFacts& facts);      // the mean of each method as bars
Result<std::string> ModelsHtml(const ReportFacts& facts);  // a row of pictures a model
std::string ScoresHtml(const ReportFacts& facts);    // the table, or a note that there is none yet
std::string CommandsHtml(const ReportFacts& facts);  // the commands that reproduce it
std::string MachineHtml(const ReportFacts& facts);
std::string CreditsHtml(const ReportFacts& facts);

}  // namespace tilegrad::train
