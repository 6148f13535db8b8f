// SPDX-License-Identifier: Apache-2.0
// A COLMAP project as frames: its cameras, the images that they belong to, and masks beside these.
//
//   <project>/sparse/0/cameras.txt, images.txt   or .bin; the largest of several models; also
//                                                <project>/sparse, <project>, and colmap/ before
//                                                them, as nerfstudio has it
//   <project>/images/a/1.jpg
//   <project>/masks/a/1.jpg.png                  as COLMAP names masks, or masks/a/1.png
#pragma once

#include <vector>

#include "fit/transforms.h"

namespace tilegrad::train {

// Images are looked for in folders `images`, and by their names alone, beside the model and up to
// two folders above it. Errors name the file.
Result<std::vector<TransformsFrame>> ReadColmapFrames(const Path& model);

// The mask of `images`/`name`, in a folder "masks" or "mask" beside `images` or in it; empty where
// there is none.
Path MaskFileOf(const Path& images, const Path& name);

}  // namespace tilegrad::train
