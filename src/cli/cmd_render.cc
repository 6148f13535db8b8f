// SPDX-License-Identifier: Apache-2.0
// tilegrad render: pictures of mesh files.
#include <fmt/core.h>

#include <set>

#include "base/error.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/render_job.h"
#include "cli/render_options.h"
#include "cli/run_folder.h"
#include "cli/unique_names.h"
#include "render/scene_fields.h"

namespace tilegrad::cli {
namespace {

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

MeshSceneOptions SceneOptionsOf(const RenderSettings& settings) {
  MeshSceneOptions options = settings.scene;
  options.ambient.fill(settings.ambient);
  options.specular.fill(settings.lighting == Lighting::kPhong ? settings.specular : 0.0f);
  return options;
}

// What is drawn otherwise than a viewer of the file would.
std::vector<std::string> MaterialNotes(const Mesh& mesh, bool soft) {
  std::vector<std::string> notes;
  for (const Material& m : mesh.materials) {
    const bool opaque = m.alpha_mode == AlphaMode::kOpaque;
    if (opaque && m.base_color.a <= 0) {
      notes.push_back(
          fmt::format("material \"{}\": its alpha of 0 is drawn as if it were 1", m.name));
    } else if (soft && (!opaque || m.base_color.a < 1)) {
      notes.push_back(fmt::format(
          "material \"{}\": --soft-delta draws it opaque, without holes or transparency", m.name));
    }
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
  glm::dvec3 origin_{0};               // of the mesh that is rendered, see LoadedMesh
  std::set<Path> files_;               // written
  Path last_;
};

FaceCulling RenderRun::Culling(const MeshScene& scene) const {
  const bool back = settings_.cull == "back" || (settings_.cull == "auto" && scene.single_sided());
  return back ? FaceCulling::kBack : FaceCulling::kNone;
}

void RenderRun::Explain(const Picture& picture, const std::string& name) const {
  for (std::size_t i = 0; i < picture.plans.size(); ++i) {
    Print("{}, pass {} of {}:\n", name, i + 1, picture.plans.size());
    for (const std::string& text : ExplainLines(picture.plans[i])) Print("  {}\n", text);
  }
}

Status RenderRun::View(const MeshScene& mesh_scene, const io::CameraView& view,
                       const PictureName& name) {
  Scene scene = mesh_scene.scene();
  scene.camera = CameraCast<float>(view.camera);
  scene.shading.lighting = settings_.lighting;
  const auto lights = LightsOf(settings_, scene.camera);
  if (UsesLights(scene.shading)) scene.lights = lights;
  if (settings_.lighting == Lighting::kSphericalHarmonics) scene.sh = settings_.sh;
  PictureRequest request{.width = view.size.width,
                         .height = view.size.height,
                         .supersampling = settings_.supersampling,
                         .soft_delta = settings_.soft_delta,
                         .culling = Culling(mesh_scene),
                         .cover = mesh_scene.cover()};
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
  views_.push_back(
      {name.stem.filename().string() + name.ending, MovedCamera(view.camera, origin_), view.size});
  return {};
}

Status RenderRun::Mesh(const std::string& file) {
  TILEGRAD_ASSIGN(const io::LoadedMesh loaded, io::LoadMesh(Path(file)));
  for (const std::string& warning : loaded.warnings) PrintNote("{}: {}\n", file, warning);
  for (const std::string& note : MaterialNotes(loaded.mesh, settings_.soft_delta > 0))
    PrintNote("{}: {}\n", file, note);
  origin_ = loaded.origin;
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
    Print("{} files, the last is {}\n", files_.size(), last_.string());
  }
  const Path cameras(settings_.write_cameras);
  if (cameras.empty() || views_.empty()) return {};
  return cameras.extension() == ".json" ? io::SaveNerfCameras(cameras, views_)
                                        : io::SaveColmapCameras(cameras, views_);
}

// One bad mesh does not keep the others from being rendered; the first error is the result.
Status RunRender(const RenderSettings& settings) {
  RenderRun run(settings);
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

void AddRender(CLI::App& app, Action* action) {
  auto settings = std::make_shared<RenderSettings>();
  auto* command = app.add_subcommand("render", "Render mesh files to pictures");
  AddRenderOptions(command, settings.get());
  command->callback([settings, action, command] {
    *action = [settings, command]() -> Status {
      TILEGRAD_TRY(CheckRenderOptions(*command, *settings));
      return RunRender(*settings);
    };
  });
}

}  // namespace tilegrad::cli
