// SPDX-License-Identifier: Apache-2.0
#include "fit/parameter_block.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {
namespace {

constexpr float kMostShininess = 1e5f;
constexpr float kMostLogGain = 3, kMostLogFocal = 1.5f;  // a factor of 20, and of 4.5
constexpr std::size_t kMaterialNumbers = 10, kCameraNumbers = 9;

// R c, for the pivot c.
float TurnedPivot(const FitScene& scene, const float* rotation, int row) {
  const float* r = rotation + 3 * row;
  return r[0] * scene.pivot[0] + r[1] * scene.pivot[1] + r[2] * scene.pivot[2];
}

void PutCamera(const FitScene& scene, const Camera& camera, float* to) {
  std::copy_n(ParametersOf(camera).rotation, 6, to);
  for (int r = 0; r < 3; ++r) {
    to[6 + r] = (camera.translation[r] + TurnedPivot(scene, camera.rotation, r)) / scene.unit;
  }
}

// Six numbers of rotation and a place; intrinsics stay those of `camera`.
CameraParameters CameraOf(const Camera& camera, const float* from) {
  CameraParameters p = ParametersOf(camera);
  std::copy_n(from, 6, p.rotation);
  return p;
}

// dL/d(block) of a camera that the values give: t = unit v - R c.
void PullCamera(const FitScene& scene, const Camera& camera, const Camera& d_camera,
                AlignedVector<float>* values, float* to) {
  Camera d = d_camera;
  for (int i = 0; i < 9; ++i) {
    d.rotation[i] -= d_camera.translation[i / 3] * scene.pivot[static_cast<std::size_t>(i % 3)];
  }
  std::copy_n(PullBack(CameraOf(camera, values->data()), d).rotation, 6, to);
  for (int r = 0; r < 3; ++r) to[6 + r] = scene.unit * d_camera.translation[r];
}

void PutSurface(const Surface& s, float* to) {
  to = std::copy(s.ambient.begin(), s.ambient.end(), to);
  to = std::copy(s.diffuse.begin(), s.diffuse.end(), to);
  std::copy(s.specular.begin(), s.specular.end(), to);
}

void TakeSurface(const float* from, Surface* s) {
  std::copy_n(from, 3, s->ambient.begin());
  std::copy_n(from + 3, 3, s->diffuse.begin());
  std::copy_n(from + 6, 3, s->specular.begin());
  s->shininess = std::clamp(std::exp(from[9]) - 1, 0.0f, kMostShininess);
}

void PutMaterial(const Surface& s, float* to) {
  PutSurface(s, to);
  to[9] = std::log(s.shininess + 1);
}

// Writing this twice changes nothing: the second sum is 1, to the bit.
void HoldMean(float* ambient, float* diffuse) {
  for (int c = 0; c < 3; ++c) {
    const float sum = ambient[c] + diffuse[c] / kDirectionsPerMean;
    ambient[c] = sum > 0 ? ambient[c] / sum : 1;
    diffuse[c] = kDirectionsPerMean * (1 - ambient[c]);
  }
}

template <class Numbers>
void Put(const Numbers& from, AlignedVector<float>* to) {
  to->assign(from.begin(), from.end());
}

void ReadValues(const FitScene& scene, ParameterBlock* block) {
  AlignedVector<float>& x = block->values;
  switch (block->what) {
    case Parameter::kPositions:
      return Put(scene.positions, &x);
    case Parameter::kColors:
      return Put(scene.colors, &x);
    case Parameter::kTexture:
      return Put(scene.texture.pixels, &x);
    case Parameter::kUv:
      return Put(scene.uvs, &x);
    case Parameter::kSh:
      return Put(scene.sh, &x);
    case Parameter::kCamera:
      x.resize(kCameraNumbers);
      return PutCamera(scene, scene.cameras[static_cast<std::size_t>(block->view)], x.data());
    case Parameter::kLight:
      x.resize(3 * scene.lights.size());
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = scene.lights[i / 3].direction[i % 3];
      return;
    case Parameter::kMaterial:
      x.resize(kMaterialNumbers);
      return PutMaterial(scene.surface, x.data());
    case Parameter::kExposure:
      x.assign(1, std::log(scene.gains[static_cast<std::size_t>(block->view)]));
      return;
    case Parameter::kFocal:
      x.assign(1, 0.0f);
      block->focal.clear();
      for (const Camera& c : scene.cameras) block->focal.push_back({c.fx, c.fy});
      return;
  }
}

void Clamp(float low, float high, AlignedVector<float>* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) (*values)[i] = std::clamp((*values)[i], low, high);
}

Status WriteCamera(const ParameterBlock& block, FitScene* scene) {
  Camera& camera = scene->cameras[static_cast<std::size_t>(block.view)];
  auto moved = CameraFromParameters(CameraOf(camera, block.values.data()), camera.near_plane);
  if (!moved.ok()) return moved.status().Within(fmt::format("camera {}", block.view));
  for (int r = 0; r < 3; ++r) {
    moved->translation[r] = scene->unit * block.values[static_cast<std::size_t>(6 + r)] -
                            TurnedPivot(*scene, moved->rotation, r);
  }
  camera = *moved;
  return {};
}

}  // namespace

std::string ParameterBlock::name() const {
  return view < 0 ? NameOf(what) : fmt::format("{}/{}", NameOf(what), view);
}

ParameterBlock MakeBlock(const FitScene& scene, Parameter what, double learning_rate, int view) {
  ParameterBlock block;
  block.what = what;
  block.learning_rate = learning_rate;
  block.view = view;
  ReadValues(scene, &block);
  for (auto* array : {&block.gradient, &block.m, &block.v}) array->resize(block.values.size());
  return block;
}

void ReadBlock(const FitScene& scene, ParameterBlock* block) {
  ReadValues(scene, block);
  block->gradient.resize(block->values.size());
}

Status WriteBlock(ParameterBlock* block, FitScene* scene) {
  AlignedVector<float>& x = block->values;
  const auto copy = [&](auto to) { std::copy(x.begin(), x.end(), to); };
  switch (block->what) {
    case Parameter::kPositions:
      copy(scene->positions.begin());
      break;
    case Parameter::kColors:
      Clamp(0, 1, &x, x.size());
      copy(scene->colors.begin());
      break;
    case Parameter::kTexture:
      Clamp(0, 1, &x, x.size());
      copy(scene->texture.pixels.begin());
      break;
    case Parameter::kUv:
      copy(scene->uvs.begin());
      break;
    case Parameter::kSh:
      copy(scene->sh.begin());
      break;
    case Parameter::kLight:
      for (std::size_t i = 0; i < x.size(); ++i) scene->lights[i / 3].direction[i % 3] = x[i];
      break;
    case Parameter::kMaterial:
      Clamp(0, std::log(kMostShininess), &x, x.size());
      if (scene->light_mean_fixed) HoldMean(x.data(), x.data() + 3);
      TakeSurface(x.data(), &scene->surface);
      break;
    case Parameter::kExposure:
      Clamp(-kMostLogGain, kMostLogGain, &x, 1);
      scene->gains[static_cast<std::size_t>(block->view)] = std::exp(x[0]);
      break;
    case Parameter::kFocal:
      Clamp(-kMostLogFocal, kMostLogFocal, &x, 1);
      for (std::size_t i = 0; i < block->focal.size(); ++i) {
        scene->cameras[i].fx = std::exp(x[0]) * block->focal[i][0];
        scene->cameras[i].fy = std::exp(x[0]) * block->focal[i][1];
      }
      break;
    case Parameter::kCamera:
      return WriteCamera(*block, scene);
  }
  return {};
}

void PullBlock(const FitScene& scene, const FitGradients& gradients, std::size_t rendered,
               ParameterBlock* block) {
  AlignedVector<float>& d = block->gradient;
  switch (block->what) {
    case Parameter::kPositions:
      return Put(gradients.positions, &d);
    case Parameter::kColors:
      return Put(gradients.colors, &d);
    case Parameter::kTexture:
      return Put(gradients.texture, &d);
    case Parameter::kUv:
      return Put(gradients.uvs, &d);
    case Parameter::kSh:
      Put(gradients.sh, &d);
      if (scene.light_mean_fixed) d[0] = 0;
      return;
    case Parameter::kLight:
      for (std::size_t i = 0; i < d.size(); ++i) d[i] = gradients.lights[i / 3].direction[i % 3];
      return;
    case Parameter::kMaterial:
      PutSurface(gradients.surface, d.data());
      d[9] = gradients.surface.shininess * (scene.surface.shininess + 1);
      return;
    case Parameter::kExposure:
      d.assign(1, scene.gains[static_cast<std::size_t>(block->view)] * gradients.gains[rendered]);
      return;
    case Parameter::kFocal:
      d.assign(1, static_cast<float>(gradients.focal));
      return;
    case Parameter::kCamera: {
      const Camera& camera = scene.cameras[static_cast<std::size_t>(block->view)];
      return PullCamera(scene, camera, gradients.cameras[rendered], &block->values, d.data());
    }
  }
}

}  // namespace tilegrad::train
