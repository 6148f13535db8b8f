// SPDX-License-Identifier: Apache-2.0
#include "api/fingerprint_cases.h"

#include <utility>

namespace tilegrad::test {
namespace {

constexpr Rate kVertex = Rate::kVertex, kCorner = Rate::kCorner;
constexpr RenderOptions kBins{.width = 130, .height = 70};    // 3 x 2 bins, one band
constexpr RenderOptions kBands{.width = 256, .height = 200};  // two bands of rows

constexpr Outputs kAlpha{.color = false, .attributes = false};
constexpr Outputs kColor{.alpha = false, .attributes = false};
constexpr Outputs kAttributes{.color = false, .alpha = false};
constexpr Outputs kDepth{.color = false, .alpha = false, .attributes = false, .depth = true};
constexpr Outputs kNormals{.color = false, .alpha = false, .attributes = false, .normals = true};
constexpr Outputs kUv{.color = false, .alpha = false, .attributes = false, .uv = true};
constexpr Outputs kBarycentrics{
    .color = false, .alpha = false, .attributes = false, .barycentrics = true};

constexpr ShadingModel kLambert{.lighting = Lighting::kLambert};
constexpr ShadingModel kPhong{.lighting = Lighting::kPhong};
constexpr ShadingModel kHarmonics{.lighting = Lighting::kSphericalHarmonics};

ShadingModel With(ShadingModel model, Normals normals) {
  model.normals = normals;
  return model;
}

std::vector<Case> Silhouettes() {
  return {
      {.name = "alpha_one_pixel",
       .shape = Shape::kSoup,
       .size = 2,
       .options = {.width = 1, .height = 1, .delta = 0.3},
       .outputs = kAlpha},
      {.name = "alpha_7x5",
       .shape = Shape::kSoup,
       .size = 12,
       .options = {.width = 7, .height = 5, .delta = 1e-2},
       .outputs = kAlpha},
      {.name = "alpha_bins", .size = 13, .options = kBins, .outputs = kAlpha},
      {.name = "alpha_bands", .size = 3, .options = kBands, .outputs = kAlpha},
      {.name = "alpha_and_white", .outputs = {}},
      {.name = "alpha_camera_only", .outputs = kAlpha, .wanted = {"camera"}},
      {.name = "alpha_mirrored", .shape = Shape::kSoup, .size = 20, .mirrored = true},
  };
}

std::vector<Case> AlphaOptions() {
  const auto of = [](const char* name, const RenderOptions& options) {
    return Case{.name = name, .size = 8, .options = options, .outputs = kAlpha};
  };
  return {
      of("error_0", {.delta = 1e-3, .max_alpha_error = 0}),
      of("error_1e-3", {.delta = 1e-3, .max_alpha_error = 1e-3}),
      of("error_1e-1", {.delta = 1e-3, .max_alpha_error = 1e-1}),
      {.name = "delta_3e-2", .size = 1, .options = {.delta = 3e-2}, .outputs = kAlpha},
      of("paper", {.alpha_rule = AlphaRule::kPaper}),
      of("paper_box_and_faces",
         {.delta = 1e-2, .alpha_rule = AlphaRule::kPaper, .paper_box = 0.25, .paper_faces = 5}),
  };
}

std::vector<Case> Geometry() {
  const RenderOptions linear{.interpolation = Interpolation::kScreenLinear};
  const RenderOptions culled{.culling = FaceCulling::kBack};
  return {
      {.name = "linear", .colors = kVertex, .options = linear},
      {.name = "culled_soup",
       .shape = Shape::kSoup,
       .size = 40,
       .colors = kVertex,
       .options = culled},
      {.name = "culled_away", .shape = Shape::kTriangle, .mirrored = true, .options = culled},
      {.name = "everything_one_pixel",
       .shape = Shape::kTriangle,
       .colors = kVertex,
       .uvs = kVertex,
       .attributes = kVertex,
       .channels = 2,
       .textures = {{}},
       .shading = kLambert,
       .lights = 1,
       .options = {.width = 1, .height = 1}},
      {.name = "large_mesh", .size = 46, .colors = kVertex, .options = {.width = 24, .height = 20}},
  };
}

std::vector<Case> CutAndBroken() {
  return {
      {.name = "linear_cut",
       .shape = Shape::kAround,
       .size = 24,
       .colors = kCorner,
       .options = {.interpolation = Interpolation::kScreenLinear}},
      {.name = "cut_colors",
       .shape = Shape::kAround,
       .size = 30,
       .colors = kVertex,
       .options = kBins},
      {.name = "cut_textured",
       .shape = Shape::kAround,
       .size = 24,
       .uvs = kCorner,
       .textures = {{}},
       .shading = kPhong,
       .lights = 1},
      {.name = "broken", .shape = Shape::kBroken, .size = 12, .colors = kVertex},
      {.name = "broken_lit",
       .shape = Shape::kBroken,
       .size = 12,
       .uvs = kVertex,
       .textures = {{.filter = Filter::kTrilinear}},
       .shading = kLambert,
       .lights = 1,
       .options = kBins},
      {.name = "no_faces", .shape = Shape::kNothing, .colors = kVertex},
  };
}

// What is asked for decides what is interpolated and which pixels go through a stage of shading.
std::vector<Case> Subsets() {
  const auto of = [](const char* name, const Outputs& outputs) {
    return Case{.name = name,
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
                .outputs = outputs};
  };
  return {
      of("only_face_ids", kNoOutputs),        of("only_color", kColor),
      of("only_attributes", kAttributes),     of("only_depth", kDepth),
      of("only_normals", kNormals),           of("only_uv", kUv),
      of("only_barycentrics", kBarycentrics), of("all_images", kEverything),
  };
}

std::vector<Case> Streams() {
  return {
      {.name = "colors_plain", .colors = kVertex, .outputs = {}},
      {.name = "colors_bands", .size = 3, .colors = kVertex, .options = kBands, .outputs = {}},
      {.name = "colors_corner", .colors = kCorner, .outputs = {}},
      {.name = "colors_clamped", .colors = kVertex, .shading = {.clamp = true}},
      {.name = "colors_with_surfaces", .colors = kVertex, .surfaces = 3},
      {.name = "attributes_1", .attributes = kVertex, .channels = 1, .outputs = kAttributes},
      {.name = "attributes_5", .attributes = kVertex, .channels = 5},
      {.name = "attributes_5_corner", .attributes = kCorner, .channels = 5, .outputs = kAttributes},
      {.name = "attributes_19", .attributes = kVertex, .channels = 19, .options = kBins},
  };
}

std::vector<Case> Textures() {
  std::vector<Case> out;
  const char* const wraps[] = {"repeat", "clamp", "mirror"};
  const char* const filters[] = {"nearest", "bilinear", "trilinear"};
  for (const int wrap : {0, 1, 2}) {
    for (const int filter : {0, 1, 2}) {
      const Picture picture{21, 13, static_cast<Wrap>(wrap), static_cast<Filter>(filter)};
      out.push_back({.name = std::string("texture_") + filters[filter] + "_" + wraps[wrap],
                     .uvs = filter == 1 ? kCorner : kVertex,
                     .textures = {picture}});
    }
  }
  return out;
}

std::vector<Case> SeveralTextures() {
  const Picture large{150, 77, Wrap::kRepeat, Filter::kTrilinear}, texel{1, 1};
  const Picture nearest{5, 9, Wrap::kClamp, Filter::kNearest}, mirrored{8, 8, Wrap::kMirror};
  return {
      {.name = "texture_minified_bands",
       .size = 3,
       .uvs = kVertex,
       .textures = {large},
       .options = kBands,
       .outputs = {}},
      {.name = "texture_times_colors", .colors = kVertex, .uvs = kCorner, .textures = {mirrored}},
      {.name = "textures_4",
       .size = 6,
       .uvs = kCorner,
       .textures = {large, nearest, mirrored, texel},
       .surfaces = 6},
      {.name = "textures_4_lit_bins",
       .size = 13,
       .colors = kVertex,
       .uvs = kVertex,
       .textures = {nearest, large, texel, mirrored},
       .surfaces = 5,
       .shading = kPhong,
       .lights = 2,
       .options = kBins},
  };
}

std::vector<Case> Lit() {
  return {
      {.name = "lambert_2", .colors = kVertex, .surfaces = 2, .shading = kLambert, .lights = 2},
      {.name = "lambert_flat", .shading = With(kLambert, Normals::kFlat), .lights = 1},
      {.name = "lambert_given",
       .normals = kVertex,
       .shading = With(kLambert, Normals::kGiven),
       .lights = 1},
      {.name = "lambert_given_corner",
       .normals = kCorner,
       .shading = With(kLambert, Normals::kGiven),
       .light_directions = true},
      {.name = "phong_2",
       .colors = kCorner,
       .uvs = kVertex,
       .textures = {{}},
       .surfaces = 3,
       .shading = kPhong,
       .lights = 2},
      {.name = "phong_directions", .surfaces = 1, .shading = kPhong, .light_directions = true},
      {.name = "phong_flat_bins",
       .size = 7,
       .shading = With(kPhong, Normals::kFlat),
       .lights = 1,
       .options = kBins},
  };
}

std::vector<Case> TwoSidedAndHarmonics() {
  return {
      {.name = "phong_two_sided",
       .shape = Shape::kSoup,
       .size = 30,
       .shading = {.lighting = Lighting::kPhong, .two_sided = true, .clamp = true},
       .lights = 2},
      {.name = "lambert_two_sided_flat",
       .shape = Shape::kSoup,
       .size = 30,
       .colors = kVertex,
       .shading = {.lighting = Lighting::kLambert, .normals = Normals::kFlat, .two_sided = true},
       .lights = 1},
      {.name = "harmonics", .colors = kVertex, .shading = kHarmonics},
      {.name = "harmonics_given",
       .uvs = kVertex,
       .normals = kVertex,
       .textures = {{}},
       .shading = With(kHarmonics, Normals::kGiven)},
      {.name = "normals_unlit", .normals = kVertex, .shading = {.normals = Normals::kGiven}},
  };
}

std::vector<Case> Batches() {
  const Picture trilinear{20, 12, Wrap::kMirror, Filter::kTrilinear};
  return {
      {.name = "batch_colors", .shape = Shape::kSoup, .size = 20, .colors = kVertex, .scenes = 3},
      {.name = "batch_lit_bins",
       .size = 3,
       .uvs = kCorner,
       .textures = {trilinear},
       .surfaces = 2,
       .shading = kPhong,
       .lights = 1,
       .options = kBins,
       .scenes = 3},
      {.name = "views_alpha", .outputs = kAlpha, .scenes = 3, .one_mesh = true},
      {.name = "views_lit",
       .colors = kVertex,
       .uvs = kVertex,
       .attributes = kVertex,
       .channels = 2,
       .textures = {trilinear, {}},
       .surfaces = 2,
       .shading = kPhong,
       .lights = 2,
       .scenes = 3,
       .one_mesh = true},
      {.name = "views_harmonics_bins",
       .colors = kCorner,
       .shading = kHarmonics,
       .options = kBins,
       .scenes = 3,
       .one_mesh = true},
  };
}

std::vector<Case> Added() {
  return {
      {.name = "add_lit",
       .colors = kVertex,
       .uvs = kVertex,
       .textures = {{}},
       .surfaces = 2,
       .shading = kPhong,
       .lights = 1,
       .mode = GradientMode::kAdd},
      {.name = "add_views",
       .attributes = kVertex,
       .channels = 1,
       .shading = kLambert,
       .light_directions = true,
       .scenes = 3,
       .one_mesh = true,
       .mode = GradientMode::kAdd},
  };
}

std::vector<Case> PartsOfGradients() {
  const auto of = [](const char* name, std::set<std::string> pulled, std::set<std::string> wanted) {
    return Case{.name = name,
                .colors = kVertex,
                .uvs = kVertex,
                .textures = {{}},
                .surfaces = 1,
                .shading = kPhong,
                .lights = 1,
                .pulled = std::move(pulled),
                .wanted = std::move(wanted)};
  };
  return {
      of("pull_color", {"color"}, {}),
      of("pull_normals", {"normals"}, {"positions"}),
      of("pull_depth", {"depth"}, {"positions", "camera"}),
      of("want_textures", {"color"}, {"textures"}),
      of("want_lights", {"color"}, {"lights"}),
      of("want_surfaces", {"color"}, {"surfaces"}),
      {.name = "want_default_surface", .colors = kVertex, .wanted = {"positions", "surfaces"}},
  };
}

}  // namespace

std::vector<Case> FingerprintCases() {
  std::vector<Case> out;
  for (const auto& group :
       {Silhouettes(), AlphaOptions(), Geometry(), CutAndBroken(), Subsets(), Streams(), Textures(),
        SeveralTextures(), Lit(), TwoSidedAndHarmonics(), Batches(), Added(), PartsOfGradients()}) {
    out.insert(out.end(), group.begin(), group.end());
  }
  return out;
}

}  // namespace tilegrad::test
