// SPDX-License-Identifier: Apache-2.0
// The options of `tilegrad render`.
#pragma once

#include <array>
#include <string>
#include <tuple>
#include <vector>

#include "cli/command.h"
#include "cli/render_job.h"
#include "render/picture/mesh_scene.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

// A bright sky above, some more from +z.
constexpr std::array<float, 9> kSky = {2.5f, -0.6f, 0.4f, 0, 0, 0, 0, 0, 0};
// The same in the axes of a mesh whose z or x is up (scene/up_axis.h).
constexpr std::array<float, 9> kSkyOfZ = {2.5f, 0.4f, 0.6f, 0, 0, 0, 0, 0, 0};
constexpr std::array<float, 9> kSkyOfX = {2.5f, 0, 0.4f, -0.6f, 0, 0, 0, 0, 0};

// What was asked for.
struct RenderSettings {
  std::vector<std::string> meshes;
  ViewSettings view;
  FileSettings file;
  MeshSceneOptions scene;
  Lighting lighting = Lighting::kLambert;
  std::vector<std::tuple<float, float, float, float>> lights;  // x y z intensity
  bool camera_light = false;
  std::vector<float> sh;  // empty: the sky above
  float ambient = 0.2f, specular = 0.4f;
  std::string cull = "auto", write_cameras, texture;
  int supersampling = 3, workers = 0;
  double soft_delta = 0;
  bool explain = false;
};

// Declares them on `command`, which writes to `settings` when it is parsed.
void AddRenderOptions(Command* command, RenderSettings* settings);

// After parsing. An option that would change nothing is a mistake: what it is for is not asked for.
Status CheckRenderOptions(const Command& command, const RenderSettings& settings);

}  // namespace tilegrad::cli
