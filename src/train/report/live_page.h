// SPDX-License-Identifier: Apache-2.0
// The live page of a running, finished or killed run: RUN/live.html, opened from the disk. Once a
// second it reloads the scripts in RUN/live, since a page from a disk may load scripts but not
// fetch files. They are made only from the run's own files.
//
// Pictures are samples/step_N.png or timelapse/N.png; meshes timelapse/N.glb and mesh.glb, or else
// what the newest checkpoint predicts for the first example of a report.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>

#include "base/file.h"
#include "base/progress.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

struct LiveSource {
  Path run;                // folder of a run or a fit, possibly without a step
  Path data = {};          // dataset of a run, for its predictions; empty: no meshes
  std::int64_t steps = 0;  // of the whole run; 0: those of config.toml, if present
  TermLabels labels = {};  // of its log, if there is no run.json
};

class LivePage {
 public:
  explicit LivePage(LiveSource source);
  const Path& file() const { return file_; }  // absolute

  // Writes the page and its first data, replacing existing ones.
  Status Start();

  // Updates the data: at once at the start of a stage, else once a second, or up to every five
  // seconds if updating would take more than a twentieth of the time.
  void Tell(const Progress& progress);
  // Writes the data for the last time, with the outcome of the work. Returns the first problem
  // since Start.
  Status Finish(const Status& outcome);

  // Whether a process keeps the page of a running run up to date.
  static bool IsKept(const Path& run);

 private:
  using Json = nlohmann::ordered_json;
  using Files = std::map<std::int64_t, Path>;  // by step
  using Clock = std::chrono::steady_clock;

  Status Write(const Json& now);
  void Note(const Status& status);
  Result<Json> State() const;
  Files Meshes(std::int64_t step) const;
  Json WriteMeshes(const Files& files);
  Status WriteMesh(const Path& source, const Path& script, std::int64_t step) const;
  Result<Json> Predicted() const;

  LiveSource source_;
  Path file_, folder_;
  std::string stage_;
  Clock::time_point next_;  // not before this
  std::set<Path> broken_;   // files that gave no mesh
  Status problem_;
};

// "file:///..." of an absolute path.
std::string FileAddress(const Path& file);

}  // namespace tilegrad::train
