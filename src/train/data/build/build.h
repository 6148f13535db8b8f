// SPDX-License-Identifier: Apache-2.0
// Makes a dataset from a source of models: loads, normalises, renders, voxelises, samples, splits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "scene/mesh.h"
#include "train/data/broken_members.h"
#include "train/data/dataset_files.h"
#include "train/data/sources/model_source.h"
#include "train/data/split.h"
#include "train/ranks/process_group.h"

namespace tilegrad::train {

struct BuildOptions {
  int image_size = 64;  // pixels
  int views = 24;
  CameraRule camera;  // its lens's width and height follow image_size
  SplitRule split;
  int per_class = 0;  // at most that many shapes of a class, chosen by a hash of the seed; 0: all
  int liveries = 0;   // at most that many models of a shape, chosen in the same way; 0: all
  int limit = 0;      // at most that many in all; 0: all
  UpAxis up = UpAxis::kY;                 // of the source's meshes
  std::vector<std::string> classes = {};  // only these; empty: all
  bool anew = false;                      // removes an existing dataset first
  bool allow_broken = false;  // any share of a published set may be unusable (broken_members.h)
  // The ranks that build the dataset together, in a folder that all see; null: this process alone.
  ProcessGroup* group = nullptr;
};

// A warning about a model that is used all the same.
struct ModelWarning {
  std::string file, text;
};

struct BuildSummary {
  std::vector<ModelInfo> models;
  DatasetInfo info;
  std::vector<RejectedModel> rejected;
  BrokenMembers broken;                // the same, counted by reason
  std::vector<ModelWarning> warnings;  // of models that this build read, not of kept ones
  std::vector<IgnoredFile> ignored;    // by the source
  int reused = 0;                      // model files kept from an earlier build
  int renewed = 0;                     // made again, since their models are not what they were
  std::uint64_t bytes = 0;             // of the dataset's files
};

// Writes the files of dataset.h to `folder`. Keeps readable model files of the same recipe whose
// models are unchanged (ModelSource::IsUnchanged): an interrupted build resumes and gives the same
// bytes, with any number of workers and ranks. Lists models that fail in rejected.jsonl and omits
// them. `stop` ends it between models with kCancelled. Errors: a folder with a dataset of another
// recipe, options out of range, no usable model, too many broken ones of a published set, a full
// disk. With a group every rank calls it; rank 0 gets the summary, without warnings of models that
// others read.
Result<BuildSummary> BuildDataset(const ModelSource& source, const BuildOptions& options,
                                  const Path& folder, const Workers& workers, const Watch& watch);

}  // namespace tilegrad::train
