// SPDX-License-Identifier: Apache-2.0
// tilegrad render: pictures of mesh files.
#include <fmt/core.h>

#include <map>
#include <set>
#include <tuple>

#include "base/error.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/render_job.h"
#include "cli/run_folder.h"
#include "cli/unique_names.h"

namespace tilegrad::cli {
namespace {

// Where the light of no --light stands, seen from the camera: above and to the left.
constexpr std::array<float, 3> kKeyLight = {-0.4f, 0.6f, 1.0f};
constexpr float kKeyIntensity = 0.8f;
// A bright sky above, some more from +z.
constexpr std::array<float, 9> kSky = {2.5f, -0.6f, 0.4f, 0, 0, 0, 0, 0, 0};

struct RenderSettings {
  std::vector<std::string> meshes;
  ViewSettings view;
  FileSettings file;
  MeshSceneOptions scene;
  Lighting lighting = Lighting::kLambert;
  std::vector<std::tuple<float, float, float, float>> lights;  // x y z intensity
  bool camera_light = false;
  std::vector<float> sh = {kSky.begin(), kSky.end()};
  float ambient = 0.2f, specular = 0.4f;
  std::string cull = "auto", write_cameras;
  int supersampling = 3, workers = 0;
  double soft_delta = 0;
  bool explain = false;
};

// A direction of the camera's axes in the world.
std::array<float, 3> ToWorld(const Camera& camera, const std::array<float, 3>& v) {
  std::array<float, 3> out;
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] =
        camera.rotation[c] * v[0] + camera.rotation[3 + c] * v[1] + camera.rotation[6 + c] * v[2];
  }
  return out;
}

std::vector<shade::DirectionalLight> LightsOf(const RenderSettings& settings,
                                              const Camera& camera) {
  if (settings.lights.empty()) return {{ToWorld(camera, kKeyLight), kKeyIntensity}};
  std::vector<shade::DirectionalLight> lights;
  for (const auto& [x, y, z, intensity] : settings.lights) {
    const std::array<float, 3> direction = {x, y, z};
    lights.push_back({settings.camera_light ? ToWorld(camera, direction) : direction, intensity});
  }
  return lights;
}

MeshSceneOptions SceneOptionsOf(const RenderSettings& settings) {
  MeshSceneOptions options = settings.scene;
  options.ambient.fill(settings.ambient);
  options.specular.fill(settings.lighting == Lighting::kPhong ? settings.specular : 0.0f);
  return options;
}

// What is drawn otherwise than a viewer of the file would.
std::vector<std::string> MaterialNotes(const Mesh& mesh) {
  std::vector<std::string> notes;
  for (const Material& m : mesh.materials) {
    if (m.alpha_mode == AlphaMode::kOpaque && m.base_color.a >= 1) continue;
    notes.push_back(fmt::format("material \"{}\": {} is drawn opaque", m.name,
                                m.alpha_mode == AlphaMode::kMask ? "alpha mask" : "transparency"));
  }
  return notes;
}

class RenderRun {
 public:
  explicit RenderRun(const RenderSettings& settings)
      : settings_(settings), workers_(settings.workers), renderer_(workers_) {}

  Status Mesh(const std::string& file);
  Status Finish();

 private:
  Status View(const MeshScene& scene, const io::CameraView& view, const PictureName& name);
  FaceCulling Culling(const MeshScene& scene) const;
  void Explain(const Picture& picture, const std::string& name) const;

  const RenderSettings& settings_;
  Workers workers_;
  PictureRenderer renderer_;
  ProgressLine line_;
  const StopFlag& stop_ = StopOnSignals();
  UniqueNames stems_;
  std::vector<io::CameraView> views_;  // of all pictures, as they are named
  std::set<Path> files_;               // written
  Path last_;
};

FaceCulling RenderRun::Culling(const MeshScene& scene) const {
  const bool back = settings_.cull == "back" || (settings_.cull == "auto" && scene.single_sided());
  return back ? FaceCulling::kBack : FaceCulling::kNone;
}

void RenderRun::Explain(const Picture& picture, const std::string& name) const {
  for (std::size_t i = 0; i < picture.plans.size(); ++i) {
    fmt::print("{}, pass {} of {}:\n", name, i + 1, picture.plans.size());
    for (const std::string& text : ExplainLines(picture.plans[i])) fmt::print("  {}\n", text);
  }
}

Status RenderRun::View(const MeshScene& mesh_scene, const io::CameraView& view,
                       const PictureName& name) {
  ShadedScene scene = mesh_scene.scene();
  scene.camera = CameraCast<float>(view.camera);
  scene.model.lighting = settings_.lighting;
  const auto lights = LightsOf(settings_, scene.camera);
  if (settings_.lighting == Lighting::kLambert || settings_.lighting == Lighting::kPhong)
    scene.lights = lights;
  if (settings_.lighting == Lighting::kSphericalHarmonics) scene.sh = settings_.sh;
  PictureRequest request{.width = view.size.width,
                         .height = view.size.height,
                         .supersampling = settings_.supersampling,
                         .soft_delta = settings_.soft_delta,
                         .culling = Culling(mesh_scene)};
  TILEGRAD_TRY(RequestOutputs(settings_.file, &request));
  Picture picture;
  TILEGRAD_TRY(renderer_.Render(scene, request, &picture));
  TILEGRAD_ASSIGN(const auto files,
                  WritePicture(picture, settings_.scene.color_space, settings_.file, name));
  for (const Path& file : files) {
    if (files_.insert(file).second) continue;
    return InvalidArgument(
        "{}: two pictures have this name; render these meshes into folders of their own",
        file.string());
  }
  last_ = files.back();
  if (settings_.explain) Explain(picture, name.stem.string());
  views_.push_back({name.stem.filename().string() + name.ending, view.camera, view.size});
  return {};
}

Status RenderRun::Mesh(const std::string& file) {
  TILEGRAD_ASSIGN(const io::LoadedMesh loaded, io::LoadMesh(Path(file)));
  for (const std::string& warning : loaded.warnings) PrintNote("{}: {}\n", file, warning);
  for (const std::string& note : MaterialNotes(loaded.mesh)) PrintNote("{}: {}\n", file, note);
  auto views = ChooseViews(settings_.view, loaded);
  if (!views.ok()) return views.status().Within(file);
  const MeshScene scene(loaded.mesh, SceneOptionsOf(settings_));
  const std::string stem = stems_.Take(Path(file).stem().string());
  const bool single = settings_.meshes.size() == 1 && views->size() == 1;
  for (std::size_t i = 0; i < views->size(); ++i) {
    if (stop_) return Cancelled("stopped; {} files are written", files_.size());
    line_.Sink()({"rendering " + stem, i, views->size(), ""});
    const std::string name = views->size() == 1 ? stem : stem + "_" + (*views)[i].name;
    TILEGRAD_ASSIGN(const PictureName picture, NamePicture(settings_.file, name, single));
    TILEGRAD_TRY(View(scene, (*views)[i], picture).Within(file));
  }
  return {};
}

Status RenderRun::Finish() {
  line_.Finish();
  if (!files_.empty()) {
    fmt::print("{} files, the last is {}\n", files_.size(), last_.string());
  }
  const Path cameras(settings_.write_cameras);
  if (cameras.empty() || views_.empty()) return {};
  return cameras.extension() == ".json" ? io::SaveNerfCameras(cameras, views_)
                                        : io::SaveColmapCameras(cameras, views_);
}

// An option that would change nothing is a mistake: what it is for is not asked for.
Status CheckEffects(const CLI::App& command, const RenderSettings& s) {
  const bool phong = s.lighting == Lighting::kPhong,
             lit = phong || s.lighting == Lighting::kLambert;
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

// One bad mesh does not keep the others from being rendered; the first error is the result.
Status RunRender(const RenderSettings& settings) {
  RenderRun run(settings);
  Status first;
  for (const std::string& file : settings.meshes) {
    const Status status = run.Mesh(file);
    if (status.ok()) continue;
    if (!first.ok()) PrintNote("tilegrad: {}\n", status.message());
    if (first.ok()) first = status;
    if (status.code() == StatusCode::kCancelled) break;
  }
  TILEGRAD_TRY(run.Finish());
  return first;
}

// name -> value, as CLI11 takes it; --help shows the names, not the numbers behind them.
template <class T>
CLI::Option* AddChoice(CLI::App* command, const std::string& option, T* value,
                       const std::map<std::string, T>& choices, const std::string& help) {
  std::string names;
  for (const auto& [name, _] : choices) names += (names.empty() ? "" : ",") + name;
  return command->add_option(option, *value, help)
      ->transform(CLI::CheckedTransformer(choices).description("{" + names + "}"))
      ->type_name("TEXT");
}

void AddViewOptions(CLI::App* command, ViewSettings* view) {
  command->add_option("--size", view->size,
                      "pixels of the pictures, as 512 or 640x480 [what the cameras say, else 512]");
  auto* cameras = command->add_option(
      "--cameras", view->camera_file,
      "a picture for each camera of: a COLMAP model (folder), a NeRF transforms.json, or OpenCV's "
      "K and poses (.json; docs/cameras.md)");
  command
      ->add_option("--opencv-centre", view->opencv_centre,
                   "where OpenCV's K has the centre of the first pixel: at (0,0), as OpenCV "
                   "does, or at (0.5,0.5)")
      ->check(CLI::IsMember({"integer", "half"}))
      ->capture_default_str();
  auto* gltf = command->add_option("--gltf-camera", view->gltf_camera,
                                   "cameras of the glTF file: a name, a number from 0, or all");
  auto* eye = command->add_option("--eye", view->eye, "stand at X Y Z")->expected(3);
  command->add_option("--target", view->target, "with --eye: look at X Y Z")
      ->expected(3)
      ->needs(eye)
      ->capture_default_str();
  command->add_option("--up", view->up, "with --eye: X Y Z points up")
      ->expected(3)
      ->needs(eye)
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
  command->add_option("--sh", s->sh, "nine coefficients of spherical harmonics")->expected(9);
  AddChoice<NormalSource>(command, "--normals", &s->scene.normals,
                          {{"auto", NormalSource::kAuto},
                           {"smooth", NormalSource::kSmooth},
                           {"flat", NormalSource::kFlat}},
                          "auto (default): the file's own, flat where it has none");
  AddChoice<shade::Filter>(command, "--filter", &s->scene.filter,
                           {{"nearest", shade::Filter::kNearest},
                            {"bilinear", shade::Filter::kBilinear},
                            {"trilinear", shade::Filter::kTrilinear}},
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
                      "a file (.png, .exr, .npy) for one picture, else a folder [this one]");
  command->add_option("--format", s->file.format, "in a folder: png (default), exr or npy")
      ->check(CLI::IsMember({"png", "exr", "npy"}));
  command
      ->add_option("--outputs", s->file.outputs,
                   "any of color, alpha, depth, normals, uv, faces; separated by commas")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--background", s->file.background, "R G B, each 0 to 1, sRGB [transparent]")
      ->expected(3)
      ->check(CLI::Range(0.0, 1.0));
  command
      ->add_option("--supersample", s->supersampling,
                   "samples along each side of a pixel, for colour and alpha")
      ->check(CLI::Range(1, 16))
      ->capture_default_str();
  command
      ->add_option("--soft-delta", s->soft_delta,
                   "alpha is the soft silhouette of equation 6 with this delta, above 0")
      ->check(CLI::PositiveNumber);
  command->add_option(
      "--write-cameras", s->write_cameras,
      "write the cameras too: FILE.json as NeRF's transforms, else a COLMAP folder");
  command->add_flag("--explain", s->explain, "print what was computed, how much, and the time");
}

}  // namespace

void AddRender(CLI::App& app, Action* action) {
  auto settings = std::make_shared<RenderSettings>();
  auto* command = app.add_subcommand("render", "Render mesh files to pictures");
  command->add_option("meshes", settings->meshes, "mesh files: " + io::MeshFileEndings())
      ->required();
  AddFileOptions(command, settings.get());
  AddViewOptions(command, &settings->view);
  AddShadingOptions(command, settings.get());
  AddWorkersOption(command, &settings->workers);
  command->callback([settings, action, command] {
    *action = [settings, command]() -> Status {
      TILEGRAD_TRY(CheckEffects(*command, *settings));
      return RunRender(*settings);
    };
  });
}

}  // namespace tilegrad::cli
