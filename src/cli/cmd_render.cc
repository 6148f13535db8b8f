// SPDX-License-Identifier: Apache-2.0
// tilegrad render: pictures of mesh files.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "base/output_guard.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/mesh_options.h"
#include "cli/render_job.h"
#include "cli/run_folder.h"
#include "render/picture/mesh_scene.h"
#include "render/scene_fields.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {
namespace {

// The options of `tilegrad render`.

// A bright sky above, some more from +z.
constexpr std::array<float, 9> kSky = {2.5f, -0.6f, 0.4f, 0, 0, 0, 0, 0, 0};
// The same in the axes of a mesh whose z or x is up (scene/mesh.h).
constexpr std::array<float, 9> kSkyOfZ = {2.5f, 0.4f, 0.6f, 0, 0, 0, 0, 0, 0};
constexpr std::array<float, 9> kSkyOfX = {2.5f, 0, 0.4f, -0.6f, 0, 0, 0, 0, 0};

// The command line.
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

void AddViewOptions(Command* command, ViewSettings* view) {
  command->Add("--size", &view->size,
               "image size in pixels, as 512 or 640x480 [from the cameras; 512 without --cameras]");
  command->Add("--cameras", &view->camera_file,
               "render one image per camera of a COLMAP model or project (folder), a NeRF "
               "transforms.json, or OpenCV's K and poses (.json; docs/rendering.md)");
  command->Add("--opencv-centre", &view->opencv_centre,
               "centre of the first pixel in OpenCV's K: (0,0), as OpenCV calibrates, or (0.5,0.5)",
               {OneOf{{"integer", "half"}}});
  command->Add("--gltf-camera", &view->gltf_camera,
               "cameras of the glTF file: a name, a number from 0, or all",
               {Excludes{{"--cameras"}}});
  command->Add("--eye", &view->eye, "camera position X Y Z",
               {Numbers{3}, Excludes{{"--cameras", "--gltf-camera"}}});
  command->Add("--target", &view->target, "with --eye: look-at point X Y Z",
               {Numbers{3}, Needs{"--eye"}});
  command->Add("--up", &view->up, "up axis of the mesh: y, z or x; with --eye also X Y Z");
  command->Add("--turntable", &view->turntable, "number of views around the mesh",
               {NoDefault{}, Range{1, 100000}, Excludes{{"--cameras", "--gltf-camera", "--eye"}}});
  command->Add("--fov", &view->fov, "full vertical field of view, degrees");
  command->Add("--azimuth", &view->azimuth, "camera azimuth, degrees; 90 looks at the +z side");
  command->Add("--elevation", &view->elevation, "camera elevation, degrees");
  command->Add("--distance", &view->distance,
               "distance from the centre of the mesh, world units; 0: the mesh fills the image");
  command->Add("--margin", &view->margin, "margin on each side, as a fraction of the image");
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
  command->Add("--ambient", &s->ambient, "ambient light");
  command->Add("--specular", &s->specular, "specular coefficient k_s of phong");
  command->Add("--shininess", &s->scene.shininess, "shininess exponent alpha of phong");
  command->Add("--sh", &s->sh, "nine coefficients of spherical harmonics [a bright sky]",
               {Numbers{9}});
  command->Add("--normals",
               Choice(&s->scene.normals, {{"auto", NormalSource::kAuto},
                                          {"smooth", NormalSource::kSmooth},
                                          {"flat", NormalSource::kFlat}}),
               "auto (default): the file's normals, flat if it has none");
  command->Add("--filter",
               Choice(&s->scene.filter, {{"nearest", Filter::kNearest},
                                         {"bilinear", Filter::kBilinear},
                                         {"trilinear", Filter::kTrilinear}}),
               "texture lookup: nearest, bilinear or trilinear (default)");
  command->Add(
      "--color-space",
      Choice(&s->scene.color_space, {{"linear", ColorSpace::kLinear}, {"srgb", ColorSpace::kSrgb}}),
      "colour space of the lighting: linear (default), as in viewers, or srgb, the values in the "
      "files, as in training");
  command->Add("--cull", &s->cull, "back faces: auto follows the file's materials",
               {OneOf{{"auto", "back", "none"}}});
}

void AddFileOptions(Command* command, RenderSettings* s) {
  command->Add("--out", &s->file.out,
               "output file (.png, .exr, .npy) for one image, else a folder for NAME.png "
               "[NAME_render.png, here]");
  AddForceOption(command, &s->file.force);
  command->Add("--format", &s->file.format,
               "file format in an output folder: png (default), exr or npy",
               {OneOf{{"png", "exr", "npy"}}});
  command->Add("--outputs", &s->file.outputs,
               "any of color, alpha, depth, normals, uv, faces; separated by commas",
               {SplitAtCommas{}});
  command->Add("--background", &s->file.background, "R G B, each 0 to 1, sRGB [transparent]",
               {Numbers{3}, Range{0, 1}});
  command->Add("--supersample", &s->supersampling,
               "samples along each side of a pixel, for colour and alpha", {Range{1, 16}});
  command->Add("--soft-delta", &s->soft_delta,
               "make alpha the soft silhouette of equation 6 with this delta, above 0",
               {NoDefault{}, AboveZero()});
  command->Add("--write-cameras", &s->write_cameras,
               "also write the cameras: FILE.json as NeRF's transforms, else a COLMAP folder");
  command->Add("--explain", &s->explain, "print the stages that ran, with counts and times");
}

// Declares them on `command`, which writes to `settings` when it is parsed.
void AddRenderOptions(Command* command, RenderSettings* settings) {
  command->Add("meshes", &settings->meshes, "mesh files: " + io::MeshFileEndings(), {Required{}});
  AddFileOptions(command, settings);
  AddViewOptions(command, &settings->view);
  AddShadingOptions(command, settings);
  AddTextureOption(command, &settings->texture);
  AddWorkersOption(command, &settings->workers);
}

// After parsing. An option without effect is a mistake on the command line.
Status CheckRenderOptions(const Command& command, const RenderSettings& s) {
  const bool phong = s.lighting == Lighting::kPhong, lit = UsesLights({.lighting = s.lighting});
  const bool from_file = !s.view.camera_file.empty() || !s.view.gltf_camera.empty();
  const bool framed = !from_file && s.view.eye.empty();
  struct Effect {
    const char* option;
    bool there;
    const char* why;
  };
  const Effect effects[] = {
      {"--light", lit, "without --shading lambert or phong"},
      {"--light-at-camera", lit && !s.lights.empty(), "without --light"},
      {"--ambient", lit, "without --shading lambert or phong"},
      {"--specular", phong, "without --shading phong"},
      {"--shininess", phong, "without --shading phong"},
      {"--sh", s.lighting == Lighting::kSphericalHarmonics, "without --shading sh"},
      {"--opencv-centre", !s.view.camera_file.empty(), "without --cameras"},
      {"--up", !from_file, "with cameras from a file"},
      {"--fov", !from_file, "with cameras from a file"},
      {"--azimuth", framed, "without automatic framing"},
      {"--elevation", framed, "without automatic framing"},
      {"--distance", framed, "without automatic framing"},
      {"--margin", framed, "without automatic framing"},
  };
  for (const auto& [option, there, why] : effects) {
    if (!command.Given(option) || there) continue;
    return InvalidArgument("{} has no effect {}", option, why);
  }
  for (const auto& [x, y, z, intensity] : s.lights) {
    if (x == 0 && y == 0 && z == 0) {
      return InvalidArgument("--light 0 0 0 {}: must point towards the light", intensity);
    }
  }
  return {};
}

// Where the light of no --light stands, seen from the camera: above and to the left.
constexpr std::array<float, 3> kKeyLight = {-0.4f, 0.6f, 1.0f};
constexpr float kKeyIntensity = 0.8f;
// A direction of the camera's axes in the world.
std::array<float, 3> ToWorld(const Camera& camera, const std::array<float, 3>& v) {
  std::array<float, 3> out;
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] =
        camera.rotation[c] * v[0] + camera.rotation[3 + c] * v[1] + camera.rotation[6 + c] * v[2];
  }
  return out;
}

std::vector<Light> LightsOf(const RenderSettings& settings, const Camera& camera) {
  if (settings.lights.empty()) return {{ToWorld(camera, kKeyLight), kKeyIntensity}};
  std::vector<Light> lights;
  for (const auto& [x, y, z, intensity] : settings.lights) {
    const std::array<float, 3> direction = {x, y, z};
    lights.push_back({settings.camera_light ? ToWorld(camera, direction) : direction, intensity});
  }
  return lights;
}

std::vector<float> HarmonicsOf(const RenderSettings& settings) {
  if (!settings.sh.empty()) return settings.sh;
  const UpAxis up = UpAxisNamed(settings.view.up).value_or(UpAxis::kY);
  const auto& sky = up == UpAxis::kZ ? kSkyOfZ : up == UpAxis::kX ? kSkyOfX : kSky;
  return {sky.begin(), sky.end()};
}

MeshSceneOptions SceneOptionsOf(const RenderSettings& settings) {
  MeshSceneOptions options = settings.scene;
  options.ambient.fill(settings.ambient);
  options.specular.fill(settings.lighting == Lighting::kPhong ? settings.specular : 0.0f);
  return options;
}

// Notes on what differs from a viewer's picture of the file.
std::vector<std::string> MaterialNotes(const Mesh& mesh, bool soft) {
  std::vector<std::string> notes;
  for (const Material& m : mesh.materials) {
    const bool opaque = m.alpha_mode == AlphaMode::kOpaque;
    if (opaque && m.base_color.a <= 0) {
      notes.push_back(fmt::format("material \"{}\": alpha 0 is drawn as 1", m.name));
    } else if (soft && (!opaque || m.base_color.a < 1)) {
      notes.push_back(fmt::format(
          "material \"{}\": --soft-delta draws it opaque, without holes or transparency", m.name));
    }
  }
  return notes;
}

bool IsJson(const Path& cameras) { return cameras.extension() == ".json"; }

class RenderRun {
 public:
  explicit RenderRun(const RenderSettings& settings)
      : settings_(settings),
        workers_(settings.workers),
        renderer_(workers_),
        guard_(settings.file.force) {
    const std::string& cameras = settings.view.camera_file;
    if (!cameras.empty()) {
      const auto model = io::FindColmapModel(cameras);
      guard_.AddInput(model ? model->folder : Path(cameras));
    }
    for (const std::string& mesh : settings.meshes) guard_.AddInput(mesh);
  }

  // Whether files of cameras may be written, before anything is rendered.
  Status CheckCameras() const {
    const Path out(settings_.write_cameras);
    if (out.empty()) return {};
    return guard_.CheckAll(IsJson(out) ? std::vector<Path>{out} : io::ColmapFiles(out));
  }

  Status Mesh(const std::string& file) {
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(Path(file)));
    TILEGRAD_TRY(TakeTexture(settings_.texture, &loaded).Within(file));
    for (const std::string& warning : loaded.warnings) PrintNote("{}: {}\n", file, warning);
    for (const std::string& note : MaterialNotes(loaded.mesh, settings_.soft_delta > 0))
      PrintNote("{}: {}\n", file, note);
    origin_ = loaded.origin;
    auto views = ChooseViews(settings_.view, loaded);
    if (!views.ok()) return views.status().Within(file);
    guard_.AddInputs(loaded.files);
    const std::string stem = stems_.Take(Path(file).stem().string());
    TILEGRAD_ASSIGN(const auto names, NamePictures(stem, *views));
    const MeshScene scene(loaded.mesh, SceneOptionsOf(settings_));
    empty_.clear();
    for (std::size_t i = 0; i < views->size(); ++i) {
      if (stop_) return Cancelled("stopped after {}", Count(rendered_.size(), "file"));
      line_.Sink()({"rendering " + stem, i, views->size(), ""});
      TILEGRAD_TRY(View(scene, (*views)[i], names[i]).Within(file));
    }
    if (!empty_.empty()) WarnOfEmptyImages(file, views->size());
    return {};
  }

  Status Finish() {
    line_.Finish();
    std::vector<std::string> files;
    for (const Path& file : rendered_) files.push_back(file.string());
    PrintResult({{"files", files}});
    if (rendered_.size() == 1) Print("wrote {}\n", rendered_.back().string());
    if (rendered_.size() > 1) {
      const Path folder = rendered_.back().parent_path();
      Print("wrote {} to {}\n", Count(rendered_.size(), "file"),
            folder.empty() ? "this folder" : folder.string());
    }
    return settings_.write_cameras.empty() || views_.empty() ? Status() : WriteCameras();
  }

 private:
  void WarnOfEmptyImages(const std::string& file, std::size_t images) const {
    PrintNote(
        "tilegrad: warning: {}: is not seen in {} of {}, such as {}: it may lie behind the camera "
        "or outside the image, show its back (--cull none), or have no area\n",
        file, empty_.size(), Count(images, "image"), empty_.front());
  }

  Result<std::vector<PictureName>> NamePictures(const std::string& stem,
                                                const std::vector<io::CameraView>& views) {
    const bool single = settings_.meshes.size() == 1 && views.size() == 1;
    // This folder may have the mesh's textures in it, chair.png of chair.obj.
    const std::string base = settings_.file.out.empty() ? stem + "_render" : stem;
    std::vector<PictureName> names;
    for (const io::CameraView& view : views) {
      const std::string name = views.size() == 1 ? base : base + "_" + view.name;
      TILEGRAD_ASSIGN(names.emplace_back(), NamePicture(settings_.file, name, single));
      TILEGRAD_TRY(ClaimFiles(names.back()));
    }
    return names;
  }

  // Before anything is rendered.
  Status ClaimFiles(const PictureName& name) {
    for (const Path& file : PictureFiles(settings_.file, name)) {
      if (!files_.insert(file).second) {
        return InvalidArgument(
            "{}: two images have this name; render these meshes into separate folders",
            file.string());
      }
      TILEGRAD_TRY(guard_.Check(file));
    }
    return {};
  }

  Status View(const MeshScene& mesh_scene, const io::CameraView& view, const PictureName& name) {
    Scene scene = mesh_scene.scene();
    scene.camera = CameraCast<float>(view.camera);
    scene.shading.lighting = settings_.lighting;
    const auto lights = LightsOf(settings_, scene.camera);
    if (UsesLights(scene.shading)) scene.lights = lights;
    const std::vector<float> sh = HarmonicsOf(settings_);
    if (settings_.lighting == Lighting::kSphericalHarmonics) scene.sh = sh;
    PictureRequest request{.width = view.size.width,
                           .height = view.size.height,
                           .supersampling = settings_.supersampling,
                           .soft_delta = settings_.soft_delta,
                           .culling = Culling(mesh_scene),
                           .cover = mesh_scene.cover()};
    TILEGRAD_TRY(RequestOutputs(settings_.file, &request));
    Picture picture;
    TILEGRAD_TRY(renderer_.Render(scene, request, &picture));
    const auto transparent = [](float alpha) { return alpha == 0; };
    if (!picture.alpha.empty() && std::ranges::all_of(picture.alpha, transparent))
      empty_.push_back(name.stem.filename().string() + name.ending);
    TILEGRAD_TRY(WritePicture(picture, settings_.scene.color_space, settings_.file, name));
    const std::vector<Path> files = PictureFiles(settings_.file, name);
    rendered_.insert(rendered_.end(), files.begin(), files.end());
    if (settings_.explain) Explain(picture, name.stem.string());
    views_.push_back({name.stem.filename().string() + name.ending,
                      MovedCamera(view.camera, origin_), view.size});
    return {};
  }

  Status WriteCameras() const {
    const Path out(settings_.write_cameras);
    return IsJson(out) ? io::SaveNerfCameras(out, views_) : io::SaveColmapCameras(out, views_);
  }

  FaceCulling Culling(const MeshScene& scene) const {
    const bool back =
        settings_.cull == "back" || (settings_.cull == "auto" && scene.single_sided());
    return back ? FaceCulling::kBack : FaceCulling::kNone;
  }

  void Explain(const Picture& picture, const std::string& name) const {
    for (std::size_t i = 0; i < picture.plans.size(); ++i) {
      Print("{}, pass {} of {}:\n", name, i + 1, picture.plans.size());
      for (const std::string& text : ExplainLines(picture.plans[i])) Print("  {}\n", text);
    }
  }

  const RenderSettings& settings_;
  Workers workers_;
  PictureRenderer renderer_;
  OutputGuard guard_;
  ProgressLine line_;
  const StopFlag& stop_ = StopOnSignals();
  UniqueNames stems_;
  std::vector<io::CameraView> views_;  // of all pictures, as they are named
  glm::dvec3 origin_{0};               // of the mesh that is rendered, see LoadedMesh
  std::vector<std::string> empty_;     // images that show nothing of that mesh
  std::set<Path> files_;               // that are written, or will be
  std::vector<Path> rendered_;         // those that are there
};

// One bad mesh does not keep the others from being rendered; the first error is the result.
Status RunRender(const RenderSettings& settings) {
  RenderRun run(settings);
  TILEGRAD_TRY(run.CheckCameras());
  Status first;
  for (const std::string& file : settings.meshes) {
    const Status status = run.Mesh(file);
    if (status.ok()) continue;
    if (!first.ok()) PrintNote("tilegrad: {}\n", status.message());
    const bool stopped = status.code() == StatusCode::kCancelled;
    if (first.ok() || stopped) first = status;
    if (stopped) break;
  }
  TILEGRAD_TRY(run.Finish());
  return first;
}

}  // namespace

void AddRender(CommandList* list) {
  auto settings = std::make_shared<RenderSettings>();
  Command& command = list->emplace_back(Command{"render", "Render mesh files to images"});
  AddRenderOptions(&command, settings.get());
  command.action = [&command, settings]() -> Status {
    TILEGRAD_TRY(CheckRenderOptions(command, *settings));
    return RunRender(*settings);
  };
}

}  // namespace tilegrad::cli
