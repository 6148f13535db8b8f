// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/split_list.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/json_text.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {
namespace {

std::optional<Split> SplitNamed(std::string_view name) {
  if (name == "train") return Split::kTrain;
  if (name == "val" || name == "validation") return Split::kValidation;
  if (name == "test") return Split::kTest;
  return std::nullopt;
}

// Of "pixel2mesh_train_list.txt"; none where the name has several of them or none.
std::optional<Split> SplitOfFile(const Path& file) {
  std::optional<Split> found;
  const std::string name = file.filename().string();
  for (const char* split : {"train", "val", "test"}) {
    if (name.find(split) == std::string::npos) continue;
    if (found) return std::nullopt;
    found = SplitNamed(split);
  }
  return found;
}

bool IsSynset(std::string_view text) {
  return text.size() == 8 && std::all_of(text.begin(), text.end(), [](char c) {
           return std::isdigit(static_cast<unsigned char>(c)) != 0;
         });
}

// Synset and model of what a line begins with; the synset is empty where it names none.
std::pair<std::string, std::string> ListedModel(std::string_view text) {
  const auto parts = SplitText(text, '/');
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
    if (IsSynset(parts[i])) return {std::string(parts[i]), std::string(parts[i + 1])};
  }
  const std::string_view name = parts.back();
  const auto view = name.rfind('_');
  if (view != std::string_view::npos && view > 8 && name[8] == '_' && IsSynset(name.substr(0, 8)))
    return {std::string(name.substr(0, 8)), std::string(name.substr(9, view - 9))};
  return {"", std::string(name)};
}

}  // namespace

class SplitListReader {
 public:
  SplitListReader(const Path& file, SplitList* list)
      : place_(file.string()), split_(SplitOfFile(file)), list_(list) {
    const std::string folder = file.parent_path().filename().string();
    if (IsSynset(folder)) synset_ = folder;
  }

  Status Read() {
    TILEGRAD_ASSIGN(const std::string text, ReadText(place_));
    const auto first = text.find_first_not_of(" \t\r\n");
    if (first != std::string::npos && text[first] == '{') return ReadJson(text);
    std::istringstream lines(text);
    int number = 0;
    for (std::string line; std::getline(lines, line);) {
      if (line.ends_with('\r')) line.pop_back();
      if (ReadLine(line, ++number)) continue;
      return DataLoss(
          "{}: line {}: expected \"<synset>/<model> <train|val|test>\", or a model in a file whose "
          "name has train, val or test in it",
          place_, number);
    }
    return {};
  }

 private:
  bool ReadLine(const std::string& line, int number) {
    const auto columns = SplitText(line, ',');
    if (columns.size() == 5) {  // the first line has their names
      const auto split = SplitNamed(columns[4]);
      if (split) list_->Add({std::string(columns[1]), std::string(columns[3])}, *split);
      return split || number == 1;
    }
    std::istringstream words(line);
    std::string model, split, more;
    if (!(words >> model)) return true;
    const auto found = words >> split ? SplitNamed(split) : split_;
    if (!found || words >> more) return false;
    auto key = ListedModel(model);
    if (key.first.empty()) key.first = synset_;
    list_->Add(key, *found);
    return true;
  }

  Status ReadJson(const std::string& text) {
    TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(text, place_));
    for (const auto& [key, value] : json.items()) {
      const auto split = SplitNamed(key);
      if (split && value.is_object()) {
        AddSynsets(value, *split);
      } else if (IsSynset(key)) {
        list_->classes_.insert(key);
      } else {
        return DataLoss("{}: \"{}\" is neither train, val or test nor a synset", place_, key);
      }
    }
    return {};
  }

  // Models are the keys of an object or the texts of an array.
  void AddSynsets(const nlohmann::json& synsets, Split split) {
    for (const auto& [synset, models] : synsets.items()) {
      for (const auto& [key, value] : models.items())
        list_->Add({synset, value.is_string() ? value.get<std::string>() : key}, split);
    }
  }

  const std::string place_;
  const std::optional<Split> split_;
  std::string synset_;  // of a list that lies in a class's folder
  SplitList* list_;
};

Result<SplitList> SplitList::Read(const std::vector<Path>& files) {
  SplitList list;
  for (const Path& file : files) TILEGRAD_TRY(SplitListReader(file, &list).Read());
  if (!files.empty() && list.empty()) return DataLoss("{}: lists no models", files[0].string());
  return list;
}

Listing SplitList::Of(const std::string& synset, const std::string& model) const {
  if (models_.empty()) return {classes_.empty() || classes_.count(synset) > 0, std::nullopt};
  auto found = models_.find({synset, model});
  if (found == models_.end()) found = models_.find({"", model});
  if (found == models_.end()) return {};
  return {true, found->second};
}

void SplitList::Add(const Key& key, Split split) {
  const auto [at, is_new] = models_.emplace(key, split);
  if (!is_new) at->second = std::max(at->second, split);
}

}  // namespace tilegrad::train
