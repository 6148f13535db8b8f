// SPDX-License-Identifier: Apache-2.0
#include "io/ply_columns.h"

#include <algorithm>
#include <string_view>
#include <utility>

namespace tilegrad::io {

bool IsPlyIndices(const PlyProperty& property) {
  return property.name == "vertex_indices" || property.name == "vertex_index";
}

PlyColumns::Column PlyColumns::ColumnOf(const PlyProperty& p) {
  // As exporters name them.
  static constexpr std::array<std::pair<std::string_view, Slot>, 27> kNames = {
      {{"x", kX},          {"y", kY},          {"z", kZ},
       {"nx", kNx},        {"ny", kNy},        {"nz", kNz},
       {"red", kRed},      {"green", kGreen},  {"blue", kBlue},
       {"r", kRed},        {"g", kGreen},      {"b", kBlue},
       {"alpha", kAlpha},  {"a", kAlpha},      {"diffuse_red", kRed},
       {"u", kU},          {"v", kV},          {"diffuse_green", kGreen},
       {"s", kU},          {"t", kV},          {"diffuse_blue", kBlue},
       {"texture_u", kU},  {"texture_v", kV},  {"diffuse_alpha", kAlpha},
       {"texcoord_u", kU}, {"texcoord_v", kV}, {"texnumber", kTexNumber}}};
  if (p.count_type) return {.list = IsPlyIndices(p) || p.name == "texcoord"};
  const auto* row = std::find_if(kNames.begin(), kNames.end(),
                                 [&](const auto& known) { return known.first == p.name; });
  if (row == kNames.end()) return {};
  // Integer colours count from 0 to the type's largest value.
  const bool color = row->second >= kRed && row->second <= kAlpha;
  const double scale = p.type == PlyType::kU8 ? 255 : p.type == PlyType::kU16 ? 65535 : 1;
  return {.slot = row->second, .scale = color ? scale : 1};
}

PlyColumns::PlyColumns(const PlyElement& element, Slot first, Slot end) {
  for (const PlyProperty& p : element.properties) {
    of.push_back(ColumnOf(p));
    const Slot slot = of.back().slot;
    if (slot >= first && slot < end) has[slot] = true;
  }
  NeedAll({kX, kY, kZ});
  NeedAll({kNx, kNy, kNz});
  NeedAll({kRed, kGreen, kBlue});
  NeedAll({kU, kV});
  has[kAlpha] = has[kAlpha] && has[kRed];
  for (Column& column : of) {
    if (column.slot != kSlots && !has[column.slot]) column.slot = kSlots;
  }
}

void PlyColumns::NeedAll(std::initializer_list<Slot> slots) {
  const bool all = std::all_of(slots.begin(), slots.end(), [&](Slot s) { return has[s]; });
  for (const Slot slot : slots) has[slot] = all;
}

}  // namespace tilegrad::io
