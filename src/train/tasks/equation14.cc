// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/equation14.h"

#include "train/losses/iou.h"

namespace tilegrad::train {

void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum) {
  sum->Add("iou", "IoU loss (1 − soft IoU of silhouettes)", weight, IouLoss(alpha, truth));
}

void AddColor(double weight, const nn::Var& loss, LossSum* sum) {
  sum->Add("color", "Colour loss (mean L1)", weight, loss);
}

}  // namespace tilegrad::train
