// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/installed.h"

#include <algorithm>

#include "base/error.h"

namespace tilegrad::train {
namespace {

constexpr InstalledSource kSources[] = {{"sweethome3d", kSweetHome3dFolder, SweetHome3dSource},
                                        {"planes", kGamesFolder, PlanesSource},
                                        {"ships", kGamesFolder, ShipsSource},
                                        {"cars", kGamesFolder, CarsSource}};

std::vector<std::string> NamesIn(const std::string& name) {
  std::vector<std::string> names;
  if (name == kThirteen) {
    for (const InstalledSource& source : kSources) names.emplace_back(source.name);
    return names;
  }
  for (const std::string_view one : SplitText(name, '+')) names.emplace_back(one);
  return names;
}

// Reports wrong names before missing packages.
Result<std::vector<const InstalledSource*>> SourcesNamed(const std::string& name) {
  std::vector<const InstalledSource*> sources;
  for (const std::string& one : NamesIn(name)) {
    sources.push_back(FindInstalledSource(one));
    if (sources.back() == nullptr || std::count(sources.begin(), sources.end(), sources.back()) > 1)
      return InvalidArgument(
          "--source {}: several must be different ones of sweethome3d, planes, ships and cars",
          name);
  }
  return sources;
}

}  // namespace

std::span<const InstalledSource> InstalledSources() { return kSources; }

const InstalledSource* FindInstalledSource(std::string_view name) {
  const auto* found = std::find_if(std::begin(kSources), std::end(kSources),
                                   [&](const InstalledSource& s) { return s.name == name; });
  return found == std::end(kSources) ? nullptr : found;
}

Result<std::unique_ptr<ModelSource>> OpenInstalledSources(const std::string& name) {
  TILEGRAD_ASSIGN(const std::vector<const InstalledSource*> installed, SourcesNamed(name));
  std::vector<std::unique_ptr<ModelSource>> sources;
  for (const InstalledSource* one : installed) {
    TILEGRAD_ASSIGN(auto source, one->open(one->folder));
    sources.push_back(std::move(source));
  }
  if (sources.size() == 1) return std::move(sources[0]);
  return CombineSources(name, std::move(sources));
}

}  // namespace tilegrad::train
