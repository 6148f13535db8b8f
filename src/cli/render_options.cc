// SPDX-License-Identifier: Apache-2.0
#include "cli/render_options.h"

#include <algorithm>
#include <map>

#include "base/error.h"
#include "cli/mesh_options.h"
#include "cli/option_checks.h"
#include "cli/option_words.h"
#include "cli/run_folder.h"
#include "render/scene_fields.h"

namespace tilegrad::cli {
namespace {

template <class T>
CLI::Option* AddChoice(CLI::App* command, const std::string& option, T* value,
                       const std::map<std::string, T>& choices, const std::string& help) {
  return command->add_option(option, *value, help)->transform(OneOf(choices))->type_name("TEXT");
}

void AddViewOptions(CLI::App* command, ViewSettings* view) {
  command->add_option(
      "--size", view->size,
      "pixels of the pictures, as 512 or 640x480 [what the cameras say; 512 without "
      "--cameras]");
  auto* cameras = command->add_option("--cameras", view->camera_file,
                                      "a picture for each camera of: a COLMAP model or project "
                                      "(folder), a NeRF transforms.json, or OpenCV's "
                                      "K and poses (.json; docs/cameras.md)");
  command
      ->add_option("--opencv-centre", view->opencv_centre,
                   "where OpenCV's K has the centre of the first pixel: at (0,0), as OpenCV "
                   "does, or at (0.5,0.5)")
      ->check(CLI::IsMember({"integer", "half"}))
      ->capture_default_str();
  auto* gltf = command->add_option("--gltf-camera", view->gltf_camera,
                                   "cameras of the glTF file: a name, a number from 0, or all");
  auto* eye = AddVector(command, "--eye", &view->eye, 3, "stand at X Y Z");
  AddVector(command, "--target", &view->target, 3, "with --eye: look at X Y Z")
      ->needs(eye)
      ->capture_default_str();
  command
      ->add_option("--up", view->up,
                   "the axis of the mesh that points up: y, z or x; with --eye also X Y Z")
      ->capture_default_str();
  auto* turntable =
      command
          ->add_option("--turntable", view->turntable, "this many views around the mesh, numbered")
          ->check(CLI::Range(1, 100000));
  for (auto* a : {cameras, gltf, eye, turntable}) {
    for (auto* b : {cameras, gltf, eye, turntable}) {
      if (a != b) a->excludes(b);
    }
  }
  command->add_option("--fov", view->fov, "whole vertical field of view, degrees")
      ->capture_default_str();
  command->add_option("--azimuth", view->azimuth, "degrees; 90 sees the side towards +z")
      ->capture_default_str();
  command->add_option("--elevation", view->elevation, "degrees above")->capture_default_str();
  command
      ->add_option("--distance", view->distance,
                   "from the middle of the mesh, world units; 0: so that it fills the picture")
      ->capture_default_str();
  command->add_option("--margin", view->margin, "share of the picture that stays free on each side")
      ->capture_default_str();
}

void AddShadingOptions(CLI::App* command, RenderSettings* s) {
  AddChoice<Lighting>(command, "--shading", &s->lighting,
                      {{"none", Lighting::kNone},
                       {"lambert", Lighting::kLambert},
                       {"phong", Lighting::kPhong},
                       {"sh", Lighting::kSphericalHarmonics}},
                      "light: none, lambert (default), phong, or spherical harmonics");
  command->add_option("--light", s->lights,
                      "X Y Z INTENSITY: direction towards a light, world; may be repeated [one "
                      "behind the camera, above on the left]");
  command->add_flag("--light-at-camera", s->camera_light,
                    "directions of --light are in the camera's axes: x right, y up, z to the eye");
  command->add_option("--ambient", s->ambient, "light from everywhere")->capture_default_str();
  command->add_option("--specular", s->specular, "k_s of phong")->capture_default_str();
  command->add_option("--shininess", s->scene.shininess, "alpha of phong")->capture_default_str();
  AddVector(command, "--sh", &s->sh, 9, "nine coefficients of spherical harmonics [a bright sky]");
  AddChoice<NormalSource>(command, "--normals", &s->scene.normals,
                          {{"auto", NormalSource::kAuto},
                           {"smooth", NormalSource::kSmooth},
                           {"flat", NormalSource::kFlat}},
                          "auto (default): the file's own, flat where it has none");
  AddChoice<Filter>(command, "--filter", &s->scene.filter,
                    {{"nearest", Filter::kNearest},
                     {"bilinear", Filter::kBilinear},
                     {"trilinear", Filter::kTrilinear}},
                    "texture lookup: nearest, bilinear or trilinear (default)");
  AddChoice<ColorSpace>(command, "--color-space", &s->scene.color_space,
                        {{"linear", ColorSpace::kLinear}, {"srgb", ColorSpace::kSrgb}},
                        "light is added in linear colours (default), as viewers do, or in the "
                        "numbers of the files (srgb), as training does");
  command->add_option("--cull", s->cull, "back faces: auto follows the file's materials")
      ->check(CLI::IsMember({"auto", "back", "none"}))
      ->capture_default_str();
}

void AddFileOptions(CLI::App* command, RenderSettings* s) {
  command->add_option("--out", s->file.out,
                      "a file (.png, .exr, .npy) for one picture, else a folder for NAME.png "
                      "[NAME_render.png, here]");
  AddForceOption(command, &s->file.force);
  command->add_option("--format", s->file.format, "in a folder: png (default), exr or npy")
      ->check(CLI::IsMember({"png", "exr", "npy"}));
  command
      ->add_option("--outputs", s->file.outputs,
                   "any of color, alpha, depth, normals, uv, faces; separated by commas")
      ->delimiter(',')
      ->capture_default_str();
  AddVector(command, "--background", &s->file.background, 3,
            "R G B, each 0 to 1, sRGB [transparent]")
      ->check(CLI::Range(0.0, 1.0));
  command
      ->add_option("--supersample", s->supersampling,
                   "samples along each side of a pixel, for colour and alpha")
      ->check(CLI::Range(1, 16))
      ->capture_default_str();
  command
      ->add_option("--soft-delta", s->soft_delta,
                   "alpha is the soft silhouette of equation 6 with this delta, above 0")
      ->check(AboveZero());
  command->add_option(
      "--write-cameras", s->write_cameras,
      "write the cameras too: FILE.json as NeRF's transforms, else a COLMAP folder");
  command->add_flag("--explain", s->explain, "print what was computed, how much, and the time");
}

}  // namespace

void AddRenderOptions(CLI::App* command, RenderSettings* settings) {
  command->add_option("meshes", settings->meshes, "mesh files: " + io::MeshFileEndings())
      ->required();
  AddFileOptions(command, settings);
  AddViewOptions(command, &settings->view);
  AddShadingOptions(command, settings);
  AddTextureOption(command, &settings->texture);
  AddWorkersOption(command, &settings->workers);
}

Status CheckRenderOptions(const CLI::App& command, const RenderSettings& s) {
  const bool phong = s.lighting == Lighting::kPhong, lit = UsesLights({.lighting = s.lighting});
  const bool from_file = !s.view.camera_file.empty() || !s.view.gltf_camera.empty();
  const bool framed = !from_file && s.view.eye.empty();
  struct Effect {
    const char* option;
    bool there;
    const char* what;
  };
  const Effect effects[] = {
      {"--light", lit, "--shading lambert or phong"},
      {"--light-at-camera", lit && !s.lights.empty(), "--light"},
      {"--ambient", lit, "--shading lambert or phong"},
      {"--specular", phong, "--shading phong"},
      {"--shininess", phong, "--shading phong"},
      {"--sh", s.lighting == Lighting::kSphericalHarmonics, "--shading sh"},
      {"--opencv-centre", !s.view.camera_file.empty(), "--cameras"},
      {"--up", !from_file, "cameras that are not of a file"},
      {"--fov", !from_file, "cameras that are not of a file"},
      {"--azimuth", framed, "a camera that is framed by itself"},
      {"--elevation", framed, "a camera that is framed by itself"},
      {"--distance", framed, "a camera that is framed by itself"},
      {"--margin", framed, "a camera that is framed by itself"},
  };
  for (const auto& [option, there, what] : effects) {
    if (command.count(option) == 0 || there) continue;
    return InvalidArgument("{} would do nothing: it is for {}", option, what);
  }
  for (const auto& [x, y, z, intensity] : s.lights) {
    if (x == 0 && y == 0 && z == 0) {
      return InvalidArgument("--light 0 0 0 {}: must point towards the light", intensity);
    }
  }
  return {};
}

}  // namespace tilegrad::cli
