// SPDX-License-Identifier: Apache-2.0
#include "io/threemf_paint.h"

#include <algorithm>
#include <array>
#include <optional>

namespace tilegrad::io {
namespace {

// What stands in quotes behind `name`, which begins with a space and ends with "=".
std::string_view ValueOf(std::string_view tag, std::string_view name) {
  const std::size_t found = tag.find(name);
  if (found == std::string_view::npos) return {};
  const std::string_view rest = tag.substr(std::min(found + name.size() + 1, tag.size()));
  return rest.substr(0, rest.find_first_of("\"'"));
}

}  // namespace

bool HasPaintedTriangles(std::string_view model_xml) {
  // Of the base materials' extension, and as slicers have it.
  constexpr std::array<std::string_view, 6> kPaint = {
      " pid=", " p1=", " p2=", " p3=", ":mmu_segmentation=", " paint_color="};
  using Paint = std::array<std::string_view, kPaint.size()>;
  std::optional<Paint> first;  // of this object
  for (std::size_t at = model_xml.find('<'); at != std::string_view::npos;
       at = model_xml.find('<', at + 1)) {
    const std::string_view tag = model_xml.substr(at, model_xml.find('>', at) - at);
    if (tag.find("colorgroup") != std::string_view::npos) return true;
    if (tag.starts_with("<object")) first.reset();
    if (!tag.starts_with("<triangle ")) continue;
    Paint paint;
    std::transform(kPaint.begin(), kPaint.end(), paint.begin(),
                   [&](std::string_view name) { return ValueOf(tag, name); });
    if (first && *first != paint) return true;
    first = paint;
  }
  return false;
}

}  // namespace tilegrad::io
