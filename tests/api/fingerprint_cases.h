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
  kBall,    // closed, 8 size^2 faces
  kSoup,    // `size` faces, anywhere before the camera
  kAround,  // `size` faces around the camera: many are cut by the near plane or behind it
  kBroken,  // `size` sound faces, and some that are degenerate, doubled, tiny, huge or far away
};

struct Picture {
  int width = 16, height = 8;
  Wrap wrap = Wrap::kRepeat;
  Filter filter = Filter::kBilinear;
};

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
  RenderOptions options{};
  Outputs outputs = kEverything;
  int scenes = 1;         // each with another camera
  bool one_mesh = false;  // scenes share their arrays, and those of their gradients
  GradientMode mode = GradientMode::kOverwrite;
  std::set<std::string> pulled{};  // images that have cotangents; empty: all that are rendered
  std::set<std::string> wanted{};  // gradients; empty: of all that the scene has
};

inline constexpr Rate kVertex = Rate::kVertex, kCorner = Rate::kCorner;
inline constexpr RenderOptions kBins{.width = 130, .height = 70};    // 3 x 2 bins, one band
inline constexpr RenderOptions kBands{.width = 256, .height = 200};  // two bands of rows
inline constexpr Outputs kAlpha{.color = false, .attributes = false};
inline constexpr Outputs kColor{.alpha = false, .attributes = false};
inline constexpr ShadingModel kLambert{.lighting = Lighting::kLambert};
inline constexpr ShadingModel kPhong{.lighting = Lighting::kPhong};
inline constexpr Picture kTrilinear{20, 12, Wrap::kMirror, Filter::kTrilinear};

inline const Case kFingerprintCases[] = {
    {.name = "all_images",
     .shape = Shape::kSoup,
     .size = 30,
     .colors = kVertex,
     .uvs = kVertex,
     .attributes = kVertex,
     .channels = 3,
     .textures = {{}},
     .shading = kLambert,
     .lights = 1,
     .options = {.width = 70, .height = 40}},
    {.name = "only_color",
     .shape = Shape::kSoup,
     .size = 30,
     .colors = kVertex,
     .uvs = kVertex,
     .attributes = kVertex,
     .channels = 3,
     .textures = {{}},
     .shading = kLambert,
     .lights = 1,
     .options = {.width = 70, .height = 40},
     .outputs = kColor},
    {.name = "alpha_bands", .size = 3, .options = kBands, .outputs = kAlpha},
    {.name = "error_1e-1",
     .size = 8,
     .options = {.delta = 1e-3, .max_alpha_error = 1e-1},
     .outputs = kAlpha},
    {.name = "paper_box_and_faces",
     .size = 8,
     .options =
         {.delta = 1e-2, .alpha_rule = AlphaRule::kPaper, .paper_box = 0.25, .paper_faces = 5},
     .outputs = kAlpha},
    {.name = "culled_soup",
     .shape = Shape::kSoup,
     .size = 40,
     .colors = kVertex,
     .options = {.culling = FaceCulling::kBack}},
    {.name = "large_mesh", .size = 46, .colors = kVertex, .options = {.width = 24, .height = 20}},
    {.name = "linear_cut",
     .shape = Shape::kAround,
     .size = 24,
     .colors = kCorner,
     .options = {.interpolation = Interpolation::kScreenLinear}},
    {.name = "cut_textured",
     .shape = Shape::kAround,
     .size = 24,
     .uvs = kCorner,
     .textures = {{}},
     .shading = kPhong,
     .lights = 1},
    {.name = "broken_lit",
     .shape = Shape::kBroken,
     .size = 12,
     .uvs = kVertex,
     .textures = {{.filter = Filter::kTrilinear}},
     .shading = kLambert,
     .lights = 1,
     .options = kBins},
    {.name = "attributes_19", .attributes = kVertex, .channels = 19, .options = kBins},
    {.name = "textures_4_lit_bins",
     .size = 13,
     .colors = kVertex,
     .uvs = kVertex,
     .textures = {{5, 9, Wrap::kClamp, Filter::kNearest},
                  {150, 77, Wrap::kRepeat, Filter::kTrilinear},
                  {1, 1},
                  {8, 8, Wrap::kMirror}},
     .surfaces = 5,
     .shading = kPhong,
     .lights = 2,
     .options = kBins},
    {.name = "lambert_given_corner",
     .normals = kCorner,
     .shading = {.lighting = Lighting::kLambert, .normals = Normals::kGiven},
     .light_directions = true},
    {.name = "lambert_two_sided_flat",
     .shape = Shape::kSoup,
     .size = 30,
     .colors = kVertex,
     .shading = {.lighting = Lighting::kLambert, .normals = Normals::kFlat, .two_sided = true},
     .lights = 1},
    {.name = "phong_two_sided",
     .shape = Shape::kSoup,
     .size = 30,
     .shading = {.lighting = Lighting::kPhong, .two_sided = true, .clamp = true},
     .lights = 2},
    {.name = "harmonics_given",
     .uvs = kVertex,
     .normals = kVertex,
     .textures = {{}},
     .shading = {.lighting = Lighting::kSphericalHarmonics, .normals = Normals::kGiven}},
    {.name = "batch_lit_bins",
     .size = 3,
     .uvs = kCorner,
     .textures = {kTrilinear},
     .surfaces = 2,
     .shading = kPhong,
     .lights = 1,
     .options = kBins,
     .scenes = 3},
    {.name = "views_lit",
     .colors = kVertex,
     .uvs = kVertex,
     .attributes = kVertex,
     .channels = 2,
     .textures = {kTrilinear, {}},
     .surfaces = 2,
     .shading = kPhong,
     .lights = 2,
     .scenes = 3,
     .one_mesh = true},
    {.name = "add_views",
     .attributes = kVertex,
     .channels = 1,
     .shading = kLambert,
     .light_directions = true,
     .scenes = 3,
     .one_mesh = true,
     .mode = GradientMode::kAdd},
    {.name = "pull_normals",
     .colors = kVertex,
     .uvs = kVertex,
     .textures = {{}},
     .surfaces = 1,
     .shading = kPhong,
     .lights = 1,
     .pulled = {"normals"},
     .wanted = {"positions"}},
    {.name = "want_default_surface", .colors = kVertex, .wanted = {"positions", "surfaces"}},
};

}  // namespace tilegrad::test
