// SPDX-License-Identifier: Apache-2.0
// What fingerprint_test.cc renders, as a table: small scenes that between them take every path of
// the public interface.
#pragma once

#include <tilegrad/tilegrad.h>

#include <optional>
#include <set>
#include <string>
#include <vector>

namespace tilegrad::test {

enum class Shape {
  kTriangle,  // one face
  kBall,      // closed, 8 size^2 faces
  kSoup,      // `size` faces, anywhere before the camera
  kAround,    // `size` faces around the camera: many are cut by the near plane or behind it
  kBroken,    // `size` sound faces, and some that are degenerate, doubled, tiny, huge or far away
  kNothing,   // vertices, but no faces
};

struct Picture {
  int width = 16, height = 8;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
};

inline constexpr Outputs kNoOutputs{.color = false, .alpha = false, .attributes = false};
inline constexpr Outputs kEverything{true, true, true, true, true, true, true};

struct Case {
  std::string name;
  Shape shape = Shape::kBall;
  int size = 4;
  std::optional<Rate> colors{}, uvs{}, normals{}, attributes{};
  int channels = 0;
  std::vector<Picture> textures{};
  int surfaces = 0;  // more than one: faces take them in turn
  ShadingModel shading{};
  int lights = 0;
  bool light_directions = false;
  bool mirrored = false;  // camera
  RenderOptions options{};
  Outputs outputs = kEverything;
  int scenes = 1;         // each with another camera
  bool one_mesh = false;  // scenes share their arrays, and those of their gradients
  GradientMode mode = GradientMode::kOverwrite;
  std::set<std::string> pulled{};  // images that have cotangents; empty: all that are rendered
  std::set<std::string> wanted{};  // gradients; empty: of all that the scene has
};

std::vector<Case> FingerprintCases();

}  // namespace tilegrad::test
