// SPDX-License-Identifier: Apache-2.0
#include "train/data/build/choose.h"

#include <algorithm>
#include <map>
#include <set>

#include "base/error.h"
#include "base/rng.h"

namespace tilegrad::train {

namespace {

bool IsWanted(const std::vector<std::string>& classes, const std::string& name) {
  return classes.empty() || std::find(classes.begin(), classes.end(), name) != classes.end();
}

}  // namespace

std::vector<std::size_t> ChooseEntries(const std::vector<SourceEntry>& entries,
                                       const BuildOptions& options) {
  struct Candidate {
    std::uint64_t shape_hash, hash;
    std::size_t entry;
    auto operator<=>(const Candidate&) const = default;
  };
  const auto shape_of = [&](std::size_t i) {
    return entries[i].class_name + "/" +
           (entries[i].shape.empty() ? entries[i].id : entries[i].shape);
  };
  std::vector<Candidate> order;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!IsWanted(options.classes, entries[i].class_name)) continue;
    const std::uint64_t seed = Mix64(options.split.seed);
    order.push_back({HashText(shape_of(i), seed),
                     HashText(entries[i].class_name + "/" + entries[i].id, seed), i});
  }
  std::sort(order.begin(), order.end());
  std::map<std::string, int> shapes, models;  // taken of a class, of a shape
  std::vector<std::size_t> chosen;
  for (const Candidate& c : order) {
    int &of_class = shapes[entries[c.entry].class_name], &of_shape = models[shape_of(c.entry)];
    if (of_shape == 0 && options.per_class > 0 && of_class >= options.per_class) continue;
    if (options.liveries > 0 && of_shape >= options.liveries) continue;
    if (options.limit > 0 && chosen.size() >= static_cast<std::size_t>(options.limit)) break;
    of_class += of_shape++ == 0;
    chosen.push_back(c.entry);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Status CheckClasses(const std::vector<SourceEntry>& entries,
                    const std::vector<std::string>& classes) {
  std::set<std::string> there;
  for (const SourceEntry& entry : entries) there.insert(entry.class_name);
  for (const std::string& name : classes) {
    if (there.count(name) > 0) continue;
    return InvalidArgument("--classes: \"{}\" is none of the source's classes: {}", name,
                           fmt::join(there, ", "));
  }
  return {};
}

namespace {

Status CheckRange(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return InvalidArgument("{} must be in [{}, {}], got {}", name, low, high, value);
}

}  // namespace

Status CheckOptions(const BuildOptions& options) {
  TILEGRAD_TRY(CheckRange("the image size", options.image_size, 8, 1024));
  TILEGRAD_TRY(CheckRange("the number of views", options.views, 1, 1024));
  TILEGRAD_TRY(CheckRange("the number per class", options.per_class, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the number of liveries", options.liveries, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the limit", options.limit, 0, INT32_MAX));
  TILEGRAD_TRY(CheckRange("the test share", options.split.test_share, 0, 0.9));
  TILEGRAD_TRY(CheckRange("the validation share", options.split.validation_share, 0, 0.9));
  return CheckRange("the sum of the test and validation shares",
                    options.split.test_share + options.split.validation_share, 0, 0.95);
}

}  // namespace tilegrad::train
