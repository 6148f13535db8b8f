// SPDX-License-Identifier: Apache-2.0
// Pictures that are looked for in a folder, rather than named.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"

namespace tilegrad::io {

// By the endings of their names; sorted.
struct PictureNames {
  std::vector<Path> read;    // PNG, JPEG and WebP
  std::vector<Path> others;  // formats that cameras and programs write, and that are not read

  // "2 pictures not in PNG, JPEG or WebP: a.heic, b.tif"; empty where there are none.
  std::string DescribeOthers() const;
};

// Empty if there is no such folder.
PictureNames PicturesIn(const Path& folder);

}  // namespace tilegrad::io
