// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/equation14.h"

#include "train/losses/iou.h"
#include "train/losses/laplacian.h"
#include "train/losses/smoothness.h"

namespace tilegrad::train {

void AddIou(double weight, const nn::Var& alpha, const nn::Tensor& truth, LossSum* sum) {
  sum->Add("iou", "IoU loss (1 − soft IoU of silhouettes)", weight, IouLoss(alpha, truth));
}

void AddColor(double weight, const nn::Var& loss, LossSum* sum) {
  sum->Add("color", "Colour loss (mean L1)", weight, loss);
}

void AddRegularizers(const LossConfig& weights, const DeformedSpheres& meshes, LossSum* sum) {
  sum->Add("smoothness", "Smoothness (normals of neighbouring faces)", weights.smoothness,
           SmoothnessLoss(meshes.positions, meshes.sphere.mesh().faces, meshes.sphere.topology()));
  sum->Add("laplacian", "Laplacian of the movement", weights.laplacian,
           LaplacianLoss(meshes.movement, meshes.sphere.topology()));
}

}  // namespace tilegrad::train
