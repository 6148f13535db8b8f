// SPDX-License-Identifier: Apache-2.0
// What networks say of pictures, and generators make of noise.
#pragma once

#include <span>

#include "nn/nn.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

// Of a batch of B. What a network does not say is an invalid Var. Light is in the axes of each
// picture's camera.
struct Prediction {
  nn::Var movement{};    // [B, V, 3] from what is deformed, before normalisation
  nn::Var positions{};   // [B, V, 3]
  nn::Var colors{};      // [B, V, 3] linear, not clamped
  nn::Var textures{};    // [B, h, h, 3] in [0, 1], by the sphere's longitude and latitude
  nn::Var flow{};        // [B, 2, h, w] in [-1, 1] (nn/ops.h)
  nn::Var directions{};  // [B, 3] unit, to the light; Lambert and Phong
  nn::Var shininess{};   // [B]; Phong
  nn::Var sh{};          // [B, 9]; harmonics
  nn::Var pose{};        // [B, 10] Pose of the picture's camera (picture_lookup.h)
  nn::Var cameras{};     // [B, 7] (ops/weak_cameras.h), quaternions unit
  // Of a network that predicts N cameras per picture: all of them (`cameras` holds the likeliest),
  // and their logits.
  nn::Var camera_choices{};  // [B N, 7]
  nn::Var choice_logits{};   // [B, N]
  nn::Var keypoints{};       // [B, K, 3]
};

// Number i, a deformed `sphere`, with its texture, or else with colours brought into [0, 1] if it
// has any. An error if it is not valid.
Result<Mesh> MeshOf(const SphereModel& sphere, const Prediction& prediction, std::size_t i);

// [B][4][size][size] bytes as networks take them: [B, 4, size, size] in [0, 1].
nn::Tensor InputOf(nn::Context& context, std::span<const std::uint8_t> images, int size);

// Item i of a batch [B, ...].
inline std::span<const float> ItemOf(const nn::Var& batch, std::size_t i) {
  const std::span<const float> all = batch.value().span<float>();
  const std::size_t size = all.size() / static_cast<std::size_t>(batch.shape()[0]);
  return all.subspan(i * size, size);
}

}  // namespace tilegrad::train
