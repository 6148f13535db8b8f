// SPDX-License-Identifier: Apache-2.0
// Rows of pictures as the paper's figures 5 and 6.
#pragma once

#include <string>
#include <vector>

#include "train/tasks/task.h"
#include "train/tasks/textured_image/held_out_views.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {

struct ShownObject {
  std::string name;
  const PredictedObject& object;  // from the first view
  const HeldOutViews::Views& truth;
};

// input | texture + light | texture | light | the true texture and light | for each other view
// texture and true texture | map.
Result<std::vector<ShownPicture>> PicturesOf(const ShownObject& shown, ObjectPictures& pictures,
                                             int size);
// Such rows below each other, all cells of one size.
ImageU8 SheetOf(const std::vector<std::vector<ShownPicture>>& rows, int size);

}  // namespace tilegrad::train
