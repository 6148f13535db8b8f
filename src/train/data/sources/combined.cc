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
      : name_(std::move(name)), sources_(std::move(sources)) {
    for (std::size_t s = 0; s < sources_.size(); ++s) {
      const auto& entries = sources_[s]->entries();
      for (std::size_t e = 0; e < entries.size(); ++e) {
        entries_.push_back(entries[e]);
        entries_.back().file = sources_[s]->name() + ": " + entries[e].file;
        places_[entries_.back().file] = {s, e};
      }
    }
    SortEntries(&entries_);
  }

  std::string name() const override { return name_; }
  std::vector<std::string> credits() const override {
    std::vector<std::string> all;
    for (const auto& source : sources_) {
      for (std::string& credit : source->credits()) {
        if (std::find(all.begin(), all.end(), credit) == all.end())
          all.push_back(std::move(credit));
      }
    }
    return all;
  }
  const std::vector<SourceEntry>& entries() const override { return entries_; }
  Result<SourceModel> Load(std::size_t entry) const override {
    const Place& place = places_.at(entries_[entry].file);
    return sources_[place.source]->Load(place.entry);
  }
  std::uint64_t version() const override {
    std::uint64_t version = 0;
    for (const auto& source : sources_) version = Mix64(version ^ source->version());
    return version;
  }
  std::vector<IgnoredFile> ignored() const override {
    std::vector<IgnoredFile> all;
    for (const auto& source : sources_) {
      for (IgnoredFile& file : source->ignored()) all.push_back(std::move(file));
    }
    return all;
  }

 private:
  struct Place {
    std::size_t source, entry;
  };

  const std::string name_;
  const std::vector<std::unique_ptr<ModelSource>> sources_;
  std::vector<SourceEntry> entries_;
  std::map<std::string, Place> places_;  // by SourceEntry::file
};

}  // namespace

std::unique_ptr<ModelSource> CombineSources(std::string name,
                                            std::vector<std::unique_ptr<ModelSource>> sources) {
  return std::make_unique<Combined>(std::move(name), std::move(sources));
}

}  // namespace tilegrad::train
