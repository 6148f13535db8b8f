// SPDX-License-Identifier: Apache-2.0
// Published lists of which models train, validate and test.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/file.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// A list's entry for a model. Without a split the set's own rule applies.
struct Listing {
  bool used = false;
  std::optional<Split> split;
};

class SplitList {
 public:
  // Every form in use, several files as one list:
  //   SYNSET/MODEL train|val|test         a line a model
  //   .../SYNSET/MODEL/rendering/00.dat   Pixel2Mesh: a line a view
  //   SYNSET_MODEL_VIEW.png               DIB-R: a line a view
  //   MODEL                               DVR's softras_train.lst, Occupancy Networks' train.lst
  //   id,synsetId,subSynsetId,modelId,split                   ShapeNet's all.csv
  //   {"train": {"SYNSET": {"MODEL": [views]}}, ...}          PyTorch3D and Mesh R-CNN
  //   {"SYNSET": {"id": ..., "name": ...}}                    3D-R2N2: classes, no split
  // Where lines name no split the file does: its name has train, val or test in it. A model that is
  // listed twice is held out if one of the two says so: some lists divide its views. Errors name
  // the file and the line.
  static Result<SplitList> Read(const std::vector<Path>& files);

  bool empty() const { return models_.empty() && classes_.empty(); }
  // An empty list uses every model.
  Listing Of(const std::string& synset, const std::string& model) const;
  // How many models it lists, each once.
  std::size_t size() const { return models_.size(); }

 private:
  // An empty synset matches any.
  using Key = std::pair<std::string, std::string>;
  friend class SplitListReader;
  void Add(const Key& key, Split split);

  std::map<Key, Split> models_;
  std::set<std::string> classes_;  // of lists that name nothing else
};

}  // namespace tilegrad::train
