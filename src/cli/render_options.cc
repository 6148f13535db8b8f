// SPDX-License-Identifier: Apache-2.0
#include "cli/render_options.h"

#include "base/error.h"
#include "cli/mesh_options.h"
#include "cli/run_folder.h"
#include "render/scene_fields.h"

namespace tilegrad::cli {
namespace {

void AddViewOptions(Command* command, ViewSettings* view) {
  command->Add(
      "--size", &view->size,
      "pixels of the pictures, as 512 or 640x480 [what the cameras say; 512 without --cameras]");
  command->Add("--cameras", &view->camera_file,
               "a picture for each camera of: a COLMAP model or project (folder), a NeRF "
               "transforms.json, or OpenCV's K and poses (.json; docs/rendering.md)");
  command->Add("--opencv-centre", &view->opencv_centre,
               "where OpenCV's K has the centre of the first pixel: at (0,0), as OpenCV does, or "
               "at (0.5,0.5)",
               {OneOf{{"integer", "half"}}});
  command->Add("--gltf-camera", &view->gltf_camera,
               "cameras of the glTF file: a name, a number from 0, or all",
               {Excludes{{"--cameras"}}});
  command->Add("--eye", &view->eye, "stand at X Y Z",
               {Numbers{3}, Excludes{{"--cameras", "--gltf-camera"}}});
  command->Add("--target", &view->target, "with --eye: look at X Y Z",
               {Numbers{3}, Needs{"--eye"}});
  command->Add("--up", &view->up,
               "the axis of the mesh that points up: y, z or x; with --eye also X Y Z");
  command->Add("--turntable", &view->turntable, "this many views around the mesh, numbered",
               {NoDefault{}, Range{1, 100000}, Excludes{{"--cameras", "--gltf-camera", "--eye"}}});
  command->Add("--fov", &view->fov, "whole vertical field of view, degrees");
  command->Add("--azimuth", &view->azimuth, "degrees; 90 sees the side towards +z");
  command->Add("--elevation", &view->elevation, "degrees above");
  command->Add("--distance", &view->distance,
               "from the middle of the mesh, world units; 0: so that it fills the picture");
  command->Add("--margin", &view->margin, "share of the picture that stays free on each side");
}

void AddShadingOptions(Command* command, RenderSettings* s) {
  command->Add("--shading",
               Choice(&s->lighting, {{"none", Lighting::kNone},
                                     {"lambert", Lighting::kLambert},
                                     {"phong", Lighting::kPhong},
                                     {"sh", Lighting::kSphericalHarmonics}}),
               "light: none, lambert (default), phong, or spherical harmonics");
  command->Add("--light", &s->lights,
               "X Y Z INTENSITY: direction towards a light, world; may be repeated [one behind the "
               "camera, above on the left]");
  command->Add("--light-at-camera", &s->camera_light,
               "directions of --light are in the camera's axes: x right, y up, z to the eye");
  command->Add("--ambient", &s->ambient, "light from everywhere");
  command->Add("--specular", &s->specular, "k_s of phong");
  command->Add("--shininess", &s->scene.shininess, "alpha of phong");
  command->Add("--sh", &s->sh, "nine coefficients of spherical harmonics [a bright sky]",
               {Numbers{9}});
  command->Add("--normals",
               Choice(&s->scene.normals, {{"auto", NormalSource::kAuto},
                                          {"smooth", NormalSource::kSmooth},
                                          {"flat", NormalSource::kFlat}}),
               "auto (default): the file's own, flat where it has none");
  command->Add("--filter",
               Choice(&s->scene.filter, {{"nearest", Filter::kNearest},
                                         {"bilinear", Filter::kBilinear},
                                         {"trilinear", Filter::kTrilinear}}),
               "texture lookup: nearest, bilinear or trilinear (default)");
  command->Add(
      "--color-space",
      Choice(&s->scene.color_space, {{"linear", ColorSpace::kLinear}, {"srgb", ColorSpace::kSrgb}}),
      "light is added in linear colours (default), as viewers do, or in the numbers of the files "
      "(srgb), as training does");
  command->Add("--cull", &s->cull, "back faces: auto follows the file's materials",
               {OneOf{{"auto", "back", "none"}}});
}

void AddFileOptions(Command* command, RenderSettings* s) {
  command->Add("--out", &s->file.out,
               "a file (.png, .exr, .npy) for one picture, else a folder for NAME.png "
               "[NAME_render.png, here]");
  AddForceOption(command, &s->file.force);
  command->Add("--format", &s->file.format, "in a folder: png (default), exr or npy",
               {OneOf{{"png", "exr", "npy"}}});
  command->Add("--outputs", &s->file.outputs,
               "any of color, alpha, depth, normals, uv, faces; separated by commas",
               {SplitAtCommas{}});
  command->Add("--background", &s->file.background, "R G B, each 0 to 1, sRGB [transparent]",
               {Numbers{3}, Range{0, 1}});
  command->Add("--supersample", &s->supersampling,
               "samples along each side of a pixel, for colour and alpha", {Range{1, 16}});
  command->Add("--soft-delta", &s->soft_delta,
               "alpha is the soft silhouette of equation 6 with this delta, above 0",
               {NoDefault{}, AboveZero()});
  command->Add("--write-cameras", &s->write_cameras,
               "write the cameras too: FILE.json as NeRF's transforms, else a COLMAP folder");
  command->Add("--explain", &s->explain, "print what was computed, how much, and the time");
}

}  // namespace

void AddRenderOptions(Command* command, RenderSettings* settings) {
  command->Add("meshes", &settings->meshes, "mesh files: " + io::MeshFileEndings(), {Required{}});
  AddFileOptions(command, settings);
  AddViewOptions(command, &settings->view);
  AddShadingOptions(command, settings);
  AddTextureOption(command, &settings->texture);
  AddWorkersOption(command, &settings->workers);
}

Status CheckRenderOptions(const Command& command, const RenderSettings& s) {
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
    if (!command.Given(option) || there) continue;
    return InvalidArgument("{} has no effect here; it is for {}", option, what);
  }
  for (const auto& [x, y, z, intensity] : s.lights) {
    if (x == 0 && y == 0 && z == 0) {
      return InvalidArgument("--light 0 0 0 {}: must point towards the light", intensity);
    }
  }
  return {};
}

}  // namespace tilegrad::cli
