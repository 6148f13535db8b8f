// SPDX-License-Identifier: Apache-2.0
#include "train/data/split.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/rng.h"

namespace tilegrad::train {
namespace {

struct Group {
  std::uint64_t order = UINT64_MAX;  // the smallest hash of its shapes
  std::vector<std::size_t> models;
  std::set<std::string> shapes;
  Split split = Split::kTrain;
};

// The models of a class, those that share a geometry or a shape together.
std::vector<Group> Together(const std::vector<ModelInfo>& models, int class_index) {
  std::vector<Group> groups;
  std::map<std::uint64_t, std::size_t> by_geometry;
  std::map<std::string, std::size_t> by_shape;
  for (std::size_t i = 0; i < models.size(); ++i) {
    const ModelInfo& model = models[i];
    if (model.class_index != class_index) continue;
    std::size_t group = by_shape.try_emplace(ShapeOf(model), groups.size()).first->second;
    if (group == groups.size()) groups.emplace_back();
    groups[group].models.push_back(i);
    groups[group].shapes.insert(ShapeOf(model));
    if (model.geometry == 0) continue;
    const std::size_t other = by_geometry.try_emplace(model.geometry, group).first->second;
    if (other == group) continue;
    // Another shape has this geometry, too: this group joins that one.
    groups[other].models.insert(groups[other].models.end(), groups[group].models.begin(),
                                groups[group].models.end());
    groups[other].shapes.merge(groups[group].shapes);
    groups[group] = {};
    for (auto& [key, value] : by_geometry) value = value == group ? other : value;
    for (auto& [key, value] : by_shape) value = value == group ? other : value;
  }
  std::erase_if(groups, [](const Group& g) { return g.models.empty(); });
  return groups;
}

std::vector<Group> GroupsOfClass(const std::vector<ModelInfo>& models, int class_index,
                                 const std::string& class_name, std::uint64_t seed) {
  std::vector<Group> groups = Together(models, class_index);
  for (Group& group : groups) {
    for (const std::string& shape : group.shapes)
      group.order = std::min(group.order, HashText(class_name + "/" + shape, seed));
  }
  std::sort(groups.begin(), groups.end(),
            [](const Group& a, const Group& b) { return a.order < b.order; });
  return groups;
}

// Gives `split` to training groups in order, as long as they fit into `wanted` shapes and one
// training group is left. If none fits and there must be one, it is the first.
void Take(std::vector<Group>* groups, std::size_t wanted, Split split, bool at_least_one) {
  auto training = std::count_if(groups->begin(), groups->end(),
                                [](const Group& g) { return g.split == Split::kTrain; });
  std::size_t taken = 0;
  for (Group& group : *groups) {
    if (group.split != Split::kTrain || taken + group.shapes.size() > wanted) continue;
    if (training-- == 1) break;
    group.split = split;
    taken += group.shapes.size();
  }
  if (taken == 0 && at_least_one) groups->front().split = split;
}

}  // namespace

std::uint64_t HashText(std::string_view text, std::uint64_t seed) {
  std::uint64_t hash = Mix64(seed);
  for (char c : text) hash = Mix64(hash ^ static_cast<unsigned char>(c));
  return hash;
}

void SplitModels(const std::vector<std::string>& classes, const SplitRule& rule,
                 std::vector<ModelInfo>* models) {
  for (std::size_t c = 0; c < classes.size(); ++c) {
    auto groups = GroupsOfClass(*models, static_cast<int>(c), classes[c], rule.seed);
    std::size_t count = 0;
    for (const Group& group : groups) count += group.shapes.size();
    const auto share = [&](double part) {
      return static_cast<std::size_t>(std::lround(part * static_cast<double>(count)));
    };
    if (groups.size() < 2) continue;
    Take(&groups, share(rule.test_share), Split::kTest, rule.test_share > 0);
    Take(&groups, share(rule.validation_share), Split::kValidation, false);
    for (const Group& group : groups) {
      for (std::size_t i : group.models) (*models)[i].split = group.split;
    }
  }
}

}  // namespace tilegrad::train
