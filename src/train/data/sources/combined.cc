// SPDX-License-Identifier: Apache-2.0
// Several sources as one.
#include <algorithm>
#include <map>

#include "base/rng.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

class Combined : public ModelSource {
 public:
  Combined(std::string name, std::vector<std::unique_ptr<ModelSource>> sources)
      : ModelSource({.name = std::move(name), .credits = {}}), sources_(std::move(sources)) {
    for (std::size_t s = 0; s < sources_.size(); ++s) {
      AddFacts(*sources_[s]);
      const auto& entries = sources_[s]->entries();
      for (std::size_t e = 0; e < entries.size(); ++e) {
        entries_.push_back(entries[e]);
        entries_.back().file = sources_[s]->facts().name + ": " + entries[e].file;
        places_[entries_.back().file] = {s, e};
      }
    }
    SortEntries(&entries_);
  }
  Result<SourceModel> Load(std::size_t entry) const override {
    const Place& place = places_.at(FileOf(entry));
    return sources_[place.source]->Load(place.entry);
  }

 private:
  // All but its name.
  void AddFacts(const ModelSource& source) {
    std::vector<std::string>& all = facts_.credits;
    for (const std::string& credit : source.facts().credits) {
      if (std::find(all.begin(), all.end(), credit) == all.end()) all.push_back(credit);
    }
    facts_.version = Mix64(facts_.version ^ source.facts().version);
    ignored_.insert(ignored_.end(), source.ignored().begin(), source.ignored().end());
  }

  struct Place {
    std::size_t source, entry;
  };

  const std::vector<std::unique_ptr<ModelSource>> sources_;
  std::map<std::string, Place> places_;  // by SourceEntry::file
};

}  // namespace

std::unique_ptr<ModelSource> CombineSources(std::string name,
                                            std::vector<std::unique_ptr<ModelSource>> sources) {
  return std::make_unique<Combined>(std::move(name), std::move(sources));
}

}  // namespace tilegrad::train
