// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: images and cameras in, mesh, texture, light or better cameras out.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/folder_lock.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/fit_parameters.h"
#include "cli/fit_pictures.h"
#include "cli/live_server.h"
#include "cli/run_folder.h"
#include "fit/poses/start_cameras.h"
#include "fit/run.h"
#include "io/mesh_file.h"
#include "train/run/run_files.h"

namespace tilegrad::cli {
namespace {

using train::FitConfig;
using train::Parameter;

struct FitOptions {
  std::string input, dataset_model, out = "fit", start = "auto", truth, optimize;
  std::string material = "unlit", lighting = "none", filter = "bilinear";
  std::vector<std::string> rates;
  std::vector<float> light_direction;
  int workers = 0, hold_out = 0;
  bool resume = false, doctor = false, force = false;
  FitPictures pictures;
  FitConfig config;
  LiveOption live;
};

Result<Mesh> LoadFitMesh(const std::string& path, OutputGuard* guard) {
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(path));
  guard->AddInputs(loaded.files);
  for (const auto& warning : loaded.warnings) PrintNote("tilegrad: warning: {}\n", warning);
  if (const glm::dvec3& o = loaded.origin; o != glm::dvec3(0)) {
    return InvalidArgument(
        "{}: too far from the origin to be fitted; move mesh and cameras by ({}, {}, {})", path,
        -o.x, -o.y, -o.z);
  }
  return std::move(loaded.mesh);
}

Status SetConfig(const FitOptions& options, FitConfig* config) {
  TILEGRAD_TRY(ParseParameters(options.optimize, &config->parameters));
  for (const auto& rate : options.rates) {
    TILEGRAD_TRY(ParseRate(rate, config->parameters, &config->rates));
  }
  SetMaterialAndLighting(options.material, options.lighting, config);
  config->filter = options.filter == "trilinear" ? Filter::kTrilinear : Filter::kBilinear;
  if (!options.light_direction.empty()) {
    if (options.lighting != "lambert" && options.lighting != "phong") {
      return InvalidArgument("--light-direction: --lighting {} has none; give lambert or phong",
                             options.lighting);
    }
    std::copy_n(options.light_direction.begin(), 3, config->light_direction.begin());
  }
  // Vertex colours are what a template gets if they, and no texture, are to be fitted.
  const train::ParameterSet& set = config->parameters;
  config->vertex_colors = set[Parameter::kColors];
  return {};
}

// Before anything is read or made: a folder that was misspelt would get a fit of its own.
Status CheckResume(const FitOptions& options) {
  if (!options.resume) return {};
  TILEGRAD_ASSIGN(const bool holds, train::HoldsRun(options.out));
  if (holds) return {};
  return NotFound("{}: no checkpoint to resume; leave out --resume to start a fit", options.out);
}

// What the fit is about, and in `guard` what it reads.
Result<train::FitJob> MakeJob(const FitOptions& options, OutputGuard* guard) {
  train::FitJob job;
  job.config = options.config;
  TILEGRAD_TRY(SetConfig(options, &job.config));
  guard->AddInput(options.input);
  TILEGRAD_ASSIGN(
      job.input,
      options.dataset_model.empty()
          ? train::ReadFitFolder(options.input, InputOptionsOf(options.pictures, options.hold_out))
          : train::ReadFitDataset(options.input, options.dataset_model, options.hold_out));
  PrintWarnings(job.input, 0);
  static const std::map<std::string, train::StartShape> shapes = {
      {"auto", train::StartShape::kAuto},
      {"hull", train::StartShape::kHull},
      {"sphere", train::StartShape::kSphere}};
  if (const auto shape = shapes.find(options.start); shape != shapes.end()) {
    job.config.start = shape->second;
  } else {
    TILEGRAD_ASSIGN(job.start, LoadFitMesh(options.start, guard));
  }
  if (!options.truth.empty()) {
    TILEGRAD_ASSIGN(job.truth, LoadFitMesh(options.truth, guard));
  }
  return job;
}

// Before anything is read or made.
Status CheckFolder(const FitOptions& options, const OutputGuard& guard) {
  if (options.doctor) return {};
  TILEGRAD_TRY(CheckResume(options));
  return CheckRunFolder(options.out, ExistingOf(options.resume, options.force), guard);
}

// Nobody else works in the folder from now on. --force takes away what an earlier fit left there.
Result<FolderLock> ClaimFolder(const FitOptions& options, const OutputGuard& guard) {
  TILEGRAD_ASSIGN(FolderLock lock, FolderLock::Take(options.out));
  TILEGRAD_TRY(CheckFolder(options, guard));
  TILEGRAD_TRY(guard.CheckNotRead(train::RunFiles(options.out)));
  if (options.force) TILEGRAD_TRY(train::RemoveRun(options.out));
  return lock;
}

void PrintFindings(const std::vector<train::Finding>& findings, bool all) {
  for (const auto& f : findings) {
    if (f.blocked) {
      PrintNote("tilegrad: no gradient for {} at the start: {}\n", train::NameOf(f.parameter),
                f.sentence);
    } else if (all) {
      Print("{}: {}\n", train::NameOf(f.parameter), f.sentence);
    }
  }
}

void PrintScores(const char* name, const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return;
  Print("{}: PSNR {:.2f} dB, silhouette IoU {:.1f} %\n", name, train::MeanPsnr(scores),
        100 * train::MeanIou(scores));
}

void PrintOutcome(const FitOptions& options, const train::FitOutcome& o) {
  const bool early = o.last_step < options.config.steps;
  Print("{} in {}{}\n", Count(static_cast<std::size_t>(o.last_step), "step"),
        FormatDuration(o.seconds), early ? ", for more gained nothing (--stop-gain)" : "");
  PrintScores("fitted views", o.training);
  PrintScores("held-out views", o.held_out);
  if (o.voxel_iou) Print("3D IoU at 32 voxels a side: {:.1f} %\n", 100 * *o.voxel_iou);
  if (o.camera_error_before && o.camera_error_after) {
    Print("cameras off by {:.2f} degrees at the start, {:.2f} at the end\n", *o.camera_error_before,
          *o.camera_error_after);
  }
  const Path out = options.out;
  Print("mesh {}\nlook at {}, or at it forming: tilegrad live {}\n", (out / "mesh.glb").string(),
        (out / "report.html").string(), out.string());
}

nlohmann::ordered_json ScoresJson(const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return nullptr;
  return {{"views", scores.size()},
          {"psnr", train::MeanPsnr(scores)},
          {"silhouette_iou", train::MeanIou(scores)}};
}

void PrintJson(const FitOptions& options, const train::FitOutcome& o) {
  const Path out = options.out;
  nlohmann::ordered_json json = {{"folder", out.string()},
                                 {"steps", o.last_step},
                                 {"seconds", o.seconds},
                                 {"training", ScoresJson(o.training)},
                                 {"held_out", ScoresJson(o.held_out)},
                                 {"voxel_iou", nullptr},
                                 {"mesh", (out / "mesh.glb").string()},
                                 {"report", (out / "report.html").string()}};
  if (o.voxel_iou) json["voxel_iou"] = *o.voxel_iou;
  PrintResult(json);
}

Status RunFitting(const FitOptions& options) {
  OutputGuard guard(options.force);
  TILEGRAD_TRY(CheckFolder(options, guard));
  TILEGRAD_ASSIGN(train::FitJob job, MakeJob(options, &guard));
  const Workers workers(options.workers);
  FolderLock lock;
  if (!options.doctor) {
    TILEGRAD_ASSIGN(lock, ClaimFolder(options, guard));
    job.out = options.out, job.locked = true, job.existing = train::ExistingRun::kContinue;
  }
  ProgressLine line;
  const std::size_t warnings = job.input.warnings.size();
  const Status cameras = train::StartCameras({options.pictures.find_cameras, options.resume}, &job,
                                             workers, line.Sink(), StopOnSignals());
  line.Finish();
  PrintWarnings(job.input, warnings);
  TILEGRAD_TRY(cameras);
  if (options.doctor) {
    TILEGRAD_ASSIGN(const auto findings, train::DiagnoseFit(job, workers));
    PrintFindings(findings, true);
    nlohmann::ordered_json json;
    for (const auto& f : findings)
      json.push_back({{"parameter", train::NameOf(f.parameter)},
                      {"blocked", f.blocked},
                      {"finding", f.sentence}});
    PrintResult(json);
    return {};
  }
  TILEGRAD_ASSIGN(const auto live,
                  StartLive(options.live, {options.out, {}, options.config.steps}));
  job.warn = line.Warnings();
  auto outcome = train::RunFit(job, workers, line.Sink(), StopOnSignals());
  line.Finish();
  if (!outcome.ok()) return outcome.status();
  PrintFindings(outcome->findings, false);
  PrintOutcome(options, *outcome);
  PrintJson(options, *outcome);
  return {};
}

void AddWhat(Command* command, FitOptions* o) {
  command->Add(
      "input", &o->input,
      "folder with transforms.json (as NeRF's) and images with alpha or masks; or a COLMAP "
      "project; or pictures alone, whose cameras are then found; or a dataset, with --model",
      {Required{}});
  command->Add("--model", &o->dataset_model, "CLASS/ID: a model of a tilegrad dataset");
  command->Add("--out", &o->out, "folder for mesh.glb, report.html, ...");
  AddForceOption(command, &o->force);
  command->Add("--start,--mesh", &o->start,
               "hull: what all masks have in common; sphere; or a mesh file; auto: the hull where "
               "masks and cameras allow. --mesh is the old name");
  command->Add("--optimize", &o->optimize,
               "any of positions, colors, texture, uv, camera, light, sh, material, exposure, "
               "focal; separated by commas [positions and texture, or the colors that --mesh has]");
  command->Add("--material", &o->material,
               "unlit: colors hold the light of the images; lambert, phong: light is learned "
               "beside them, and where it comes from",
               {OneOf{{"unlit", "lambert", "phong"}}});
  command->Add("--lighting", &o->lighting, "none, lambert, phong or sh",
               {OneOf{{"none", "lambert", "phong", "sh"}}});
  command->Add("--light-direction", &o->light_direction, "x y z towards the light, world",
               {Numbers{3}});
  command->Add("--filter", &o->filter, "texture lookup: bilinear or trilinear",
               {OneOf{{"bilinear", "trilinear"}}});
  command->Add("--truth", &o->truth, "a mesh to compare with (3D IoU)");
  command->Add("--hold-out", &o->hold_out,
               "hold out every N-th image to judge by; 0: those of transforms_test.json",
               {NotNegative()});
}

// Steps of each.
const std::map<std::string, std::int64_t> kQualities = {
    {"fast", 300}, {"normal", FitConfig().steps}, {"best", 3000}};

// --views-per-step for "views_per_step", and so on; and --quality, which sets --steps.
void AddNumbers(Command* command, FitConfig* config) {
  for (const train::ConfigField& field : train::FieldsOf(config)) {
    std::string name = "--" + field.key;
    std::replace(name.begin(), name.end(), '_', '-');
    const Target target = std::visit([](auto* value) -> Target { return value; }, field.target);
    std::vector<Trait> traits;
    if (field.key == "seed") traits = {NotNegative()};
    command->Add(name, target, field.help, traits);
  }
  const auto set_steps = [config](const std::string& quality) {
    const auto found = kQualities.find(quality);
    if (found != kQualities.end()) config->steps = found->second;
    return std::string();  // OneOf says what is wrong
  };
  command->Add("--quality", WordCheck{set_steps, ""},
               "fast, normal or best: 300, 1000 or 3000 steps",
               {OneOf{{"fast", "normal", "best"}}, Excludes{{"--steps"}}});
}

}  // namespace

void AddFit(CommandList* list) {
  const auto [command, options] =
      AddCommand(list, "fit", "Fit a mesh, texture, light or cameras to images by gradient descent",
                 RunFitting);
  AddWhat(command, options);
  AddPictureOptions(command, &options->pictures);
  AddNumbers(command, &options->config);
  command->Add("--rate", &options->rates, "learning rate, NAME=NUMBER (repeatable)",
               {SplitAtCommas{}});
  command->Add(
      "--resume", &options->resume,
      "go on with the fit in --out, which has saved something; a finished one with more --steps",
      {Excludes{{"--force"}}});
  command->Add("--doctor", &options->doctor,
               "only say what gets a gradient at the start, and why not");
  AddLiveOption(command, &options->live);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
