// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: images and cameras in, mesh, texture, light or better cameras out.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/fit_parameters.h"
#include "cli/fit_pictures.h"
#include "cli/live_server.h"
#include "cli/option_checks.h"
#include "cli/option_words.h"
#include "cli/run_folder.h"
#include "fit/poses/start_cameras.h"
#include "fit/run.h"
#include "io/mesh_file.h"
#include "train/run/checkpoint.h"

namespace tilegrad::cli {
namespace {

using train::FitConfig;
using train::Parameter;

struct Options {
  std::string input, dataset_model, out, start = "auto", truth, optimize, quality = "normal";
  std::string material = "unlit", lighting = "none", filter = "bilinear";
  std::vector<std::string> rates;
  std::vector<float> light_direction;
  int workers = 0, hold_out = 0;
  bool resume = false, doctor = false, force = false;
  FitPictures pictures;
  FitConfig config;
  LiveOption live;
};

Result<Mesh> Load(const std::string& path, OutputGuard* guard) {
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

Status SetConfig(const Options& options, FitConfig* config) {
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
Status CheckResume(const Options& options) {
  if (!options.resume || !train::ListCheckpoints(options.out).empty()) return {};
  return NotFound(
      "{}: no fit to go on with: there is no checkpoint in it; leave out --resume to start one",
      options.out);
}

Result<train::FitJob> MakeJob(const Options& options) {
  train::FitJob job;
  job.config = options.config;
  TILEGRAD_TRY(SetConfig(options, &job.config));
  job.guard = OutputGuard(options.force);
  if (!options.doctor) {
    TILEGRAD_TRY(CheckRunFolder(options.out, job.guard));
    TILEGRAD_TRY(CheckResume(options));
  }
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
    TILEGRAD_ASSIGN(job.start, Load(options.start, &job.guard));
  }
  if (!options.truth.empty()) {
    TILEGRAD_ASSIGN(job.truth, Load(options.truth, &job.guard));
  }
  job.out = options.out;
  job.existing = options.resume ? train::ExistingRun::kContinue : train::ExistingRun::kRefuse;
  return job;
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

void PrintOutcome(const Options& options, const train::FitOutcome& o) {
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

void PrintJson(const Options& options, const train::FitOutcome& o) {
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

Status Run(const Options& options) {
  TILEGRAD_ASSIGN(train::FitJob job, MakeJob(options));
  const Workers workers(options.workers);
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

void AddWhat(CLI::App* command, Options* o) {
  command
      ->add_option("input", o->input,
                   "folder with transforms.json (as NeRF's) and images with alpha or masks; or a "
                   "COLMAP project; or pictures alone, whose cameras are then found; or a dataset, "
                   "with --model")
      ->required();
  command->add_option("--model", o->dataset_model, "CLASS/ID: a model of a tilegrad dataset");
  command->add_option("--out", o->out, "folder for mesh.glb, report.html, ...")
      ->capture_default_str();
  AddForceOption(command, &o->force);
  command
      ->add_option("--start,--mesh", o->start,
                   "hull: what all masks have in common; sphere; or a mesh file; auto: the hull "
                   "where masks and cameras allow. --mesh is the old name")
      ->capture_default_str();
  command->add_option("--optimize", o->optimize,
                      "any of positions, colors, texture, uv, camera, light, sh, material, "
                      "exposure, focal; "
                      "separated by commas [positions and texture, or the colors that --mesh has]");
  command
      ->add_option("--material", o->material,
                   "unlit: colors hold the light of the images; lambert, phong: light is learned "
                   "beside them, and where it comes from")
      ->check(CLI::IsMember({"unlit", "lambert", "phong"}))
      ->capture_default_str();
  command->add_option("--lighting", o->lighting, "none, lambert, phong or sh")
      ->check(CLI::IsMember({"none", "lambert", "phong", "sh"}))
      ->capture_default_str();
  AddVector(command, "--light-direction", &o->light_direction, 3, "x y z towards the light, world");
  command->add_option("--filter", o->filter, "texture lookup: bilinear or trilinear")
      ->check(CLI::IsMember({"bilinear", "trilinear"}))
      ->capture_default_str();
  command->add_option("--truth", o->truth, "a mesh to compare with (3D IoU)");
  command
      ->add_option("--hold-out", o->hold_out,
                   "hold out every N-th image to judge by; 0: those of transforms_test.json")
      ->capture_default_str()
      ->check(NotNegative());
}

// Steps of each; --steps counts before it.
const std::map<std::string, std::int64_t> kQualities = {
    {"fast", 300}, {"normal", FitConfig().steps}, {"best", 3000}};

// --views-per-step for "views_per_step", and so on.
void AddNumbers(CLI::App* command, FitConfig* config) {
  for (const train::ConfigField& field : train::FieldsOf(config)) {
    std::string name = "--" + field.key;
    std::replace(name.begin(), name.end(), '_', '-');
    std::visit(
        [&](auto* value) { command->add_option(name, *value, field.help)->capture_default_str(); },
        field.target);
  }
  command->get_option("--seed")->check(NotNegative());
}

void AddQuality(CLI::App* command, Options* options) {
  command
      ->add_option("--quality", options->quality, "fast, normal or best: 300, 1000 or 3000 steps")
      ->check(CLI::IsMember({"fast", "normal", "best"}))
      ->excludes(command->get_option("--steps"))
      ->each([options](const std::string& word) {
        const auto at = kQualities.find(word);
        if (at != kQualities.end()) options->config.steps = at->second;
      });
}

}  // namespace

void AddFit(CLI::App& app, Action* action) {
  auto options = std::make_shared<Options>();
  options->out = "fit";
  auto* command = app.add_subcommand(
      "fit", "Fit a mesh, texture, light or cameras to images by gradient descent");
  AddWhat(command, options.get());
  AddPictureOptions(command, &options->pictures);
  AddNumbers(command, &options->config);
  AddQuality(command, options.get());
  command->add_option("--rate", options->rates, "learning rate, NAME=NUMBER (repeatable)")
      ->delimiter(',');
  command->add_flag("--resume", options->resume,
                    "go on with the fit in --out, which has saved something; "
                    "a finished one with more --steps");
  command->add_flag("--doctor", options->doctor,
                    "only say what gets a gradient at the start, and why not");
  AddLiveOption(command, &options->live);
  AddWorkersOption(command, &options->workers);
  command->callback([options, action] { *action = [options] { return Run(*options); }; });
}

}  // namespace tilegrad::cli
