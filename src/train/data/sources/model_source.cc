// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/model_source.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::train {

std::string SynsetName(const std::string& synset) {
  constexpr std::pair<const char*, const char*> kNames[] = {
      {"02691156", "airplane"}, {"02828884", "bench"},   {"02933112", "cabinet"},
      {"02958343", "car"},      {"03001627", "chair"},   {"03211117", "display"},
      {"03636649", "lamp"},     {"03691459", "speaker"}, {"04090263", "rifle"},
      {"04256520", "sofa"},     {"04379243", "table"},   {"04401088", "phone"},
      {"04530566", "vessel"}};
  for (const auto& [id, name] : kNames) {
    if (synset == id) return name;
  }
  return synset;
}

Result<std::vector<Path>> ListFolder(const Path& folder) {
  std::error_code error;
  std::vector<Path> out;
  std::filesystem::directory_iterator at(folder, error);
  for (; !error && at != std::filesystem::directory_iterator(); at.increment(error))
    out.push_back(at->path());
  if (error) return NotFound("{}: cannot list the folder: {}", folder.string(), error.message());
  std::sort(out.begin(), out.end());
  return out;
}

std::string SafeFileName(const std::string& text) {
  constexpr std::uint32_t kLastControl = 0x9f;  // of Unicode's second set
  std::string out;
  for (std::string_view rest = text; !rest.empty();) {
    const Utf8Character c = FirstCharacter(rest);
    const bool stays = c.code > kLastControl || std::isalnum(static_cast<int>(c.code)) ||
                       c.code == '.' || c.code == '-' || c.code == '_';
    out += c.valid && stays ? rest.substr(0, c.bytes) : "_";
    rest.remove_prefix(c.bytes);
  }
  const bool hidden = out.empty() || out[0] == '.';
  return hidden ? "_" + out : out;
}

std::vector<std::string_view> SplitText(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t end; (end = text.find(separator)) != std::string_view::npos;) {
    parts.push_back(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  parts.push_back(text);
  return parts;
}

void ModelSource::ForgetEntries() {
  files_.reserve(entries_.size());
  for (SourceEntry& entry : entries_) files_.push_back(std::move(entry.file));
  std::vector<SourceEntry>().swap(entries_);
}

void SortEntries(std::vector<SourceEntry>* entries) {
  const auto key = [](const SourceEntry& e) { return std::tie(e.class_name, e.id, e.file); };
  std::sort(entries->begin(), entries->end(),
            [&](const SourceEntry& a, const SourceEntry& b) { return key(a) < key(b); });
  std::set<std::pair<std::string, std::string>> taken;
  for (SourceEntry& entry : *entries) {
    const std::string base = entry.id;
    for (int n = 2; !taken.emplace(entry.class_name, entry.id).second; ++n)
      entry.id = base + "-" + std::to_string(n);
  }
  std::sort(entries->begin(), entries->end(),
            [&](const SourceEntry& a, const SourceEntry& b) { return key(a) < key(b); });
}

}  // namespace tilegrad::train
