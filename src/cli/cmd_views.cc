// SPDX-License-Identifier: Apache-2.0
// tilegrad views: images of a mesh from all around, with their cameras.
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/console.h"
#include "cli/mesh_options.h"
#include "cli/run_folder.h"
#include "fit/make_views.h"
#include "io/mesh_file.h"

namespace tilegrad::cli {
namespace {

struct ViewsOptions {
  std::string mesh, out, texture;
  UpAxis up = UpAxis::kY;
  bool force = false;
  train::ViewsOptions views;
};

Status RunViews(const ViewsOptions& options) {
  OutputGuard guard(options.force);
  TILEGRAD_TRY(guard.CheckFolder(options.out));  // before the mesh is read
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(options.mesh));
  for (const auto& warning : loaded.warnings) PrintNote("tilegrad: warning: {}\n", warning);
  TILEGRAD_TRY(TakeTexture(options.texture, &loaded));
  TurnUpright(options.up, &loaded.mesh);
  guard.AddInputs(loaded.files);
  ProgressLine line;
  TILEGRAD_TRY(train::MakeViews(std::move(loaded.mesh), options.views, options.out, guard,
                                line.Sink(), StopOnSignals()));
  line.Finish();
  Print("{}: {} to fit, {} held out, the mesh as truth.glb\n", options.out,
        Count(static_cast<std::size_t>(options.views.views), "image"), options.views.held_out);
  PrintResult({{"folder", options.out},
               {"views", options.views.views},
               {"held_out", options.views.held_out}});
  return {};
}

}  // namespace

void AddViews(CommandList* list) {
  const auto [command, options] = AddCommand(
      list, "views",
      "Render views around a mesh into a folder of images and cameras for tilegrad fit", RunViews);
  command->Add("mesh", &options->mesh, "a file: " + io::MeshFileEndings(), {Required{}});
  command->Add("--out", &options->out, "output folder", {Required{}});
  AddForceOption(command, &options->force);
  AddUpOption(command, &options->up);
  AddTextureOption(command, &options->texture);
  train::ViewsOptions& v = options->views;
  command->Add("--views", &v.views, "number of views to fit");
  command->Add("--held-out", &v.held_out, "number of held-out views");
  command->Add("--size", &v.size, "width and height of the images, pixels");
  command->Add("--distance", &v.distance,
               "camera distance; the mesh is scaled to an extent of 0.9");
  command->Add("--fov", &v.fov_y, "vertical field of view, degrees");
  command->Add("--lowest", &v.lowest, "elevation of the lowest camera, degrees");
  command->Add("--highest", &v.highest, "elevation of the highest camera, degrees");
}

}  // namespace tilegrad::cli
