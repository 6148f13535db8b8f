// SPDX-License-Identifier: Apache-2.0
#include "io/picture_names.h"

#include <algorithm>
#include <string_view>

#include "base/error.h"
#include "base/text.h"

namespace tilegrad::io {
namespace {

constexpr std::string_view kReadEndings[] = {".png", ".jpg", ".jpeg", ".webp"};
constexpr std::string_view kOtherEndings[] = {".heic", ".heif", ".avif", ".tif", ".tiff", ".bmp",
                                              ".gif",  ".tga",  ".jp2",  ".jxl", ".jfif", ".psd",
                                              ".exr",  ".hdr",  ".ppm",  ".pgm", ".dng",  ".cr2",
                                              ".cr3",  ".nef",  ".arw",  ".raf", ".orf"};

}  // namespace

std::string PictureNames::DescribeOthers() const {
  constexpr std::size_t kNamed = 5;
  if (others.empty()) return "";
  std::string names;
  for (std::size_t i = 0; i < std::min(others.size(), kNamed); ++i)
    names += (i == 0 ? "" : ", ") + others[i].string();
  return fmt::format("{} not in PNG, JPEG or WebP: {}{}", Count(others.size(), "picture"), names,
                     others.size() > kNamed ? ", ..." : "");
}

PictureNames PicturesIn(const Path& folder) {
  PictureNames out;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    if (!IsFile(at->path())) continue;
    const std::string ending = LowerCase(at->path().extension().string());
    if (std::ranges::find(kReadEndings, ending) != std::end(kReadEndings))
      out.read.push_back(at->path().filename());
    if (std::ranges::find(kOtherEndings, ending) != std::end(kOtherEndings))
      out.others.push_back(at->path().filename());
  }
  std::ranges::sort(out.read);
  std::ranges::sort(out.others);
  return out;
}

}  // namespace tilegrad::io
