// SPDX-License-Identifier: Apache-2.0
// A folder of pictures without cameras.
//
//   <folder>/images/a.jpg or <folder>/a.jpg     PNG, JPEG or WebP, in the order of their names
//   <folder>/masks/a.jpg.png or masks/a.png     beside images/ or in <folder>
#pragma once

#include <vector>

#include "fit/transforms.h"

namespace tilegrad::train {

inline constexpr double kUsualFov = 65;  // degrees along the longer side: main cameras of phones

// Without a picture: a lens that sees `fov` degrees along the longer side, and a pose that means
// nothing.
TransformsFrame BareFrame(double fov);

// Empty if there are no pictures. Warns of pictures in formats that are not read.
std::vector<TransformsFrame> ReadBareFrames(const Path& folder, double fov,
                                            std::vector<std::string>* warnings);

}  // namespace tilegrad::train
