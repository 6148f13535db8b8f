// SPDX-License-Identifier: Apache-2.0
// A page about a run or a fit while it goes on, or afterwards: RUN/live.html, which a browser opens
// from the disk. Once a second it loads the scripts in RUN/live again, since a page from a disk may
// load scripts but not ask for files. What they hold is read from the run's own files and from
// nothing else, so that it is the same for a run that was killed.
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
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "train/tasks/task.h"

namespace tilegrad::train {

struct LiveSource {
  Path run;                // folder of a run or a fit, which may have done no step yet
  Path data = {};          // dataset of a run, for what it predicts; empty: no meshes
  std::int64_t steps = 0;  // of the whole work; 0: as config.toml says, if there is one
  TermLabels labels = {};  // of its log, where there is no run.json
};

class LivePage {
 public:
  explicit LivePage(LiveSource source);
  const Path& file() const { return file_; }  // absolute

  // Writes the page and its first data, in place of those that are there.
  Status Start();

  // What is going on: writes the data anew, at once where a stage begins, else once a second, or up
  // to every five seconds where it would take more than a twentieth of the time.
  void Tell(const Progress& progress);
  // Writes the data for the last time, with how the work ended. Returns the first problem since
  // Start: what could not be written, or not be shown.
  Status Finish(const Status& outcome);

  // Whether somebody keeps the page of a run that goes on up to date.
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
  std::set<Path> broken_;   // what made no mesh
  Status problem_;
};

// "file:///..." of an absolute path.
std::string FileAddress(const Path& file);

}  // namespace tilegrad::train
