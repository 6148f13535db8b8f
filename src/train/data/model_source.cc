// SPDX-License-Identifier: Apache-2.0
#include "train/data/model_source.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <tuple>

namespace tilegrad::train {

std::string SafeFileName(const std::string& text) {
  std::string out = text;
  for (char& c : out) {
    const auto u = static_cast<unsigned char>(c);
    if (u > 127 || (!std::isalnum(u) && c != '.' && c != '-' && c != '_')) c = '_';
  }
  if (out.empty() || out[0] == '.') out.insert(0, "_");
  return out;
}

void SortEntries(std::vector<SourceEntry>* entries) {
  const auto key = [](const SourceEntry& e) { return std::tie(e.class_name, e.id, e.file); };
  std::sort(entries->begin(), entries->end(),
            [&](const SourceEntry& a, const SourceEntry& b) { return key(a) < key(b); });
  std::set<std::pair<std::string, std::string>> taken;
  for (SourceEntry& entry : *entries) {
    const std::string base = entry.id;
    for (int n = 2; !taken.emplace(entry.class_name, entry.id).second; ++n) {
      entry.id = base + "-" + std::to_string(n);
    }
  }
  std::sort(entries->begin(), entries->end(),
            [&](const SourceEntry& a, const SourceEntry& b) { return key(a) < key(b); });
}

}  // namespace tilegrad::train
