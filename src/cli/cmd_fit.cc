// SPDX-License-Identifier: Apache-2.0
// tilegrad fit: images and cameras in, mesh, texture, light or better cameras out.
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/command_line.h"
#include "cli/console.h"
#include "cli/fit_pictures.h"
#include "cli/live_option.h"
#include "cli/run_folder.h"
#include "fit/config.h"
#include "fit/poses/start_cameras.h"
#include "fit/run.h"
#include "io/mesh_file.h"
#include "tilegrad/status.h"
#include "train/run/run_files.h"

namespace tilegrad::cli {
namespace {

// tilegrad fit: what it says at its end.

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

// The view in which a wrong mask or camera would show.
void PrintWorst(const train::FitInput& input, const std::vector<train::ViewScore>& scores) {
  const auto worst = std::ranges::min_element(scores, {}, &train::ViewScore::iou);
  if (worst == scores.end()) return;
  Print("the worst of them: {}, silhouette IoU {:.1f} %\n",
        input.names[static_cast<std::size_t>(worst->view)], 100 * worst->iou);
}

void PrintOutcome(const train::FitOutcome& o, const train::FitInput& input, const Path& out,
                  std::int64_t steps) {
  const bool early = o.last_step < steps;
  Print("{} in {}{}\n", Count(static_cast<std::size_t>(o.last_step), "step"),
        FormatDuration(o.seconds), early ? ", stopped early (--stop-gain)" : "");
  PrintScores("fitted views", o.training);
  PrintWorst(input, o.training);
  PrintScores("held-out views", o.held_out);
  if (o.voxel_iou) Print("3D IoU at 32 voxels a side: {:.1f} %\n", 100 * *o.voxel_iou);
  if (o.camera_error_before && o.camera_error_after) {
    Print("camera error {:.2f} degrees at the start, {:.2f} at the end\n", *o.camera_error_before,
          *o.camera_error_after);
  }
  Print("mesh {}\nreport {}, live view: tilegrad live {}\n", (out / "mesh.glb").string(),
        (out / "report.html").string(), ShellWord(out.string()));
}

nlohmann::ordered_json ScoresJson(const std::vector<train::ViewScore>& scores) {
  if (scores.empty()) return nullptr;
  return {{"views", scores.size()},
          {"psnr", train::MeanPsnr(scores)},
          {"silhouette_iou", train::MeanIou(scores)}};
}

void PrintJson(const train::FitOutcome& o, const Path& out) {
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

// Of --doctor: what each parameter gets.
void PrintDiagnosis(const std::vector<train::Finding>& findings) {
  PrintFindings(findings, true);
  nlohmann::ordered_json json;
  for (const auto& f : findings)
    json.push_back({{"parameter", train::NameOf(f.parameter)},
                    {"blocked", f.blocked},
                    {"finding", f.sentence}});
  PrintResult(json);
}

// `steps`: the most that it was given.
void PrintFit(const train::FitOutcome& outcome, const train::FitInput& input, const Path& out,
              std::int64_t steps) {
  PrintFindings(outcome.findings, false);
  if (!outcome.doubt.empty()) PrintNote("tilegrad: warning: {}\n", outcome.doubt);
  PrintOutcome(outcome, input, out, steps);
  PrintJson(outcome, out);
}

// The words of tilegrad fit that name what is fitted. Errors name the word and the known ones.

using train::Parameter;

constexpr double kMostRate = 1e6;

Result<Parameter> ParameterNamed(const std::string& name) {
  std::string known;
  for (const Parameter p : train::kParameters) {
    if (name == train::NameOf(p)) return p;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", train::NameOf(p));
  }
  return InvalidArgument("cannot fit \"{}\"; choose from {}", name, known);
}

// Whether a fit of these, which are the mesh and its colours if none is named, may move `p`.
bool MayMove(const train::ParameterSet& set, Parameter p) {
  const bool usual =
      p == Parameter::kPositions || p == Parameter::kColors || p == Parameter::kTexture;
  return set.empty() ? usual : set[p];
}

// "positions,texture"
Status ParseParameters(const std::string& text, train::ParameterSet* out) {
  for (const std::string& word : PartsBetweenCommas(text)) {
    TILEGRAD_ASSIGN(const Parameter p, ParameterNamed(word));
    (*out)[p] = true;
  }
  return {};
}

// "positions=0.01", of a parameter in `fitted`; none there: those that are fitted by default.
Status ParseRate(const std::string& text, const train::ParameterSet& fitted,
                 train::LearningRates* rates) {
  const auto equals = text.find('=');
  TILEGRAD_ASSIGN(const Parameter p, ParameterNamed(text.substr(0, equals)));
  const std::string number = equals == std::string::npos ? "" : text.substr(equals + 1);
  const auto rate = RealNumber(number);
  if (!rate || !(*rate >= 0 && *rate < kMostRate)) {
    return InvalidArgument("--rate {}: expected NAME=NUMBER with a number in [0, {})", text,
                           kMostRate);
  }
  if (!MayMove(fitted, p)) {
    return InvalidArgument("--rate {}: {} is not fitted; name it in --optimize", text,
                           train::NameOf(p));
  }
  (*rates)[p] = *rate;
  return {};
}

// Of --material and --lighting, words that were checked.
void SetMaterialAndLighting(const std::string& material, const std::string& lighting,
                            train::FitConfig* config) {
  static const std::map<std::string, train::MaterialKind> materials = {
      {"unlit", train::MaterialKind::kUnlit},
      {"lambert", train::MaterialKind::kLambert},
      {"phong", train::MaterialKind::kPhong}};
  static const std::map<std::string, Lighting> lightings = {{"none", Lighting::kNone},
                                                            {"lambert", Lighting::kLambert},
                                                            {"phong", Lighting::kPhong},
                                                            {"sh", Lighting::kSphericalHarmonics}};
  config->material = materials.at(material);
  config->lighting = lightings.at(lighting);
}

// Warnings of the input from the `first` on, a few of them.
void PrintWarnings(const train::FitInput& input, std::size_t first) {
  constexpr std::size_t kShown = 3;
  const std::size_t count = input.warnings.size() - first;
  for (std::size_t i = 0; i < std::min(count, kShown); ++i) {
    PrintNote("tilegrad: warning: {}\n", input.warnings[first + i]);
  }
  if (count > kShown) PrintNote("tilegrad: warning: and {} more of these\n", count - kShown);
}

// The confidence of the stages before the fit, for people.
void PrintNotes(const train::FitInput& input) {
  if (CurrentVerbosity() != Verbosity::kFull) return;
  for (const std::string& note : input.notes) PrintNote("tilegrad: {}\n", note);
}

using train::FitConfig;

struct FitOptions {
  std::string input, dataset_model, out = "fit", start = "auto", truth, optimize;
  std::string material = "unlit", lighting = "none", filter = "bilinear";
  std::vector<std::string> rates;
  std::vector<float> light_direction;
  int workers = 0, hold_out = 0;
  bool resume = false, doctor = false, force = false, live = false;
  FitPictures pictures;
  FitConfig config;
  GivenOptions given;  // that the fit depends on
};

Result<Mesh> LoadFitMesh(const std::string& path, UpAxis up, OutputGuard* guard) {
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(path));
  guard->AddInputs(loaded.files);
  for (const auto& warning : loaded.warnings) PrintNote("tilegrad: warning: {}\n", warning);
  if (const glm::dvec3& o = loaded.origin; o != glm::dvec3(0)) {
    return InvalidArgument(
        "{}: too far from the origin to fit; move mesh and cameras by ({}, {}, {})", path, -o.x,
        -o.y, -o.z);
  }
  // glTF has y up, whatever the cameras have; others are in the cameras' world.
  const std::string ending = LowerCase(Path(path).extension().string());
  if (ending != ".glb" && ending != ".gltf") TurnUpright(up, &loaded.mesh);
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
  config->vertex_colors = config->parameters[Parameter::kColors];
  return {};
}

// Directions are given in the world of the cameras.
void TurnLight(UpAxis up, FitConfig* config) {
  auto& d = config->light_direction;
  const glm::vec3 turned = Upright(up, {d[0], d[1], d[2]});
  d = {turned.x, turned.y, turned.z};
}

// Before any work: a misspelt folder would otherwise start a new fit.
Status CheckResume(const FitOptions& options) {
  if (!options.resume) return {};
  TILEGRAD_ASSIGN(const bool holds, train::HoldsRun(options.out));
  if (holds && PathExists(Path(options.out) / train::kTrainSettings))
    return InvalidArgument("{}: is a run of tilegrad train, not a fit", options.out);
  if (holds) return {};
  return NotFound("{}: no checkpoint to resume; leave out --resume to start a fit", options.out);
}

Result<train::FitInput> ReadInput(const FitOptions& options, const Watch& watch) {
  if (options.dataset_model.empty())
    TILEGRAD_TRY(TryColmap(options.pictures, options.input, watch));
  return options.dataset_model.empty()
             ? train::ReadFitFolder(options.input,
                                    InputOptionsOf(options.pictures, options.hold_out, watch))
             : train::ReadFitDataset(options.input, options.dataset_model, options.hold_out);
}

// What the fit is about, and in `guard` what it reads.
Result<train::FitJob> MakeJob(const FitOptions& options, const Watch& watch, OutputGuard* guard) {
  train::FitJob job;
  job.config = options.config;
  TILEGRAD_TRY(SetConfig(options, &job.config));
  guard->AddInput(options.input);
  if (!options.pictures.masks.empty()) guard->AddInput(options.pictures.masks);
  TILEGRAD_ASSIGN(job.input, ReadInput(options, watch));
  PrintWarnings(job.input, 0);
  if (job.input.posed && options.given.contains("--fov"))
    PrintNote("tilegrad: warning: --fov has no effect, since the images have cameras\n");
  if (!options.light_direction.empty()) TurnLight(job.input.up, &job.config);
  static const std::map<std::string, train::StartShape> shapes = {
      {"auto", train::StartShape::kAuto},
      {"hull", train::StartShape::kHull},
      {"sphere", train::StartShape::kSphere}};
  if (const auto shape = shapes.find(options.start); shape != shapes.end()) {
    job.config.start = shape->second;
  } else {
    TILEGRAD_ASSIGN(job.start, LoadFitMesh(options.start, job.input.up, guard));
  }
  if (!options.truth.empty()) {
    TILEGRAD_ASSIGN(job.truth, LoadFitMesh(options.truth, job.input.up, guard));
  }
  TILEGRAD_TRY(train::CheckFit(job));
  return job;
}

Status CheckFolder(const FitOptions& options, const OutputGuard& guard) {
  const auto existing = ExistingOf(options.resume, options.force);
  return options.doctor ? Status() : CheckRunFolder(options.out, existing, guard);
}

Status KeepGiven(const FitOptions& options) {
  return WriteGiven(Path(options.out) / train::kFitSettings, options.given);
}

// Locks the folder. --force removes an earlier fit; --resume reads the options of that fit.
Result<FolderLock> ClaimFolder(const FitOptions& options, const OutputGuard& guard) {
  TILEGRAD_ASSIGN(FolderLock lock, FolderLock::Take(options.out));
  TILEGRAD_TRY(CheckFolder(options, guard));
  TILEGRAD_TRY(guard.CheckNotRead(train::RunFiles(options.out)));
  if (options.force) TILEGRAD_TRY(train::RemoveRun(options.out));
  if (!options.resume) TILEGRAD_TRY(KeepGiven(options));
  return lock;
}

Status RunDoctor(const FitOptions& options, train::FitJob job, const Workers& workers,
                 const Watch& watch) {
  const std::size_t warnings = job.input.warnings.size();
  TILEGRAD_TRY(train::StartCameras({options.pictures.find_cameras}, &job, workers, watch.progress,
                                   *watch.stop));
  PrintWarnings(job.input, warnings);
  TILEGRAD_ASSIGN(const auto findings, train::DiagnoseFit(job, workers, watch));
  PrintDiagnosis(findings);
  return {};
}

Status RunClaimed(const FitOptions& options, train::FitJob* job, const Workers& workers,
                  const ProgressSink& progress) {
  const std::size_t warnings = job->input.warnings.size();
  TILEGRAD_TRY(train::StartCameras({options.pictures.find_cameras, options.resume}, job, workers,
                                   progress, StopOnSignals()));
  PrintWarnings(job->input, warnings);
  PrintNotes(job->input);
  job->begun = [&options] { return KeepGiven(options); };  // of more steps, if so
  TILEGRAD_ASSIGN(const auto outcome, train::RunFit(*job, workers, progress, StopOnSignals()));
  PrintFit(outcome, job->input, options.out, options.config.steps);
  return {};
}

Status RunShown(const FitOptions& options, train::FitJob* job, const Workers& workers,
                const ProgressSink& progress) {
  Live live;
  if (options.live)
    TILEGRAD_TRY(live.Start({options.out, {}, options.config.steps, train::FitLabels()}));
  Status status = RunClaimed(options, job, workers, live.Sink(progress));
  live.Finish(status);
  return status;
}

Status RunFitting(const FitOptions& options) {
  OutputGuard guard(options.force);
  TILEGRAD_TRY(CheckFolder(options, guard));
  ProgressLine line;
  const Watch watch = line.Watching();
  TILEGRAD_ASSIGN(train::FitJob job, MakeJob(options, watch, &guard));
  const Workers workers(options.workers);
  if (options.doctor) return RunDoctor(options, std::move(job), workers, watch);
  TILEGRAD_ASSIGN(const FolderLock lock, ClaimFolder(options, guard));
  job.out = options.out;
  job.locked = true;
  job.existing = train::ExistingRun::kContinue;
  job.warn = line.Warnings();
  return WithCommand(RunShown(options, &job, workers, watch.progress),
                     "tilegrad fit --resume --out " + ShellWord(options.out));
}

// ---- Resuming with the options of an earlier call.

// Options that are not part of the fit, and those that may change on resuming.
const std::set<std::string> kCallOptions = {"--out",  "--force",   "--resume",  "--doctor",
                                            "--live", "--threads", "--workers", "--read-limit",
                                            "--json", "--quiet"};
const std::set<std::string> kMayDiffer = {"--steps", "--quality", "--timelapse",
                                          "--checkpoint-every", "--truth"};

Status TakeFromFit(const Path& fit, Command* command, CommandList* list) {
  TILEGRAD_ASSIGN(const bool holds, train::HoldsRun(fit));
  if (!holds || !PathExists(fit / train::kFitSettings)) return {};
  Continuation before;
  TILEGRAD_ASSIGN(before.then, ReadGiven(fit / train::kFitSettings));
  for (const char* name : {"input", "--start", "--truth", "--masks"}) {
    const auto found = before.then.find(name);
    if (found == before.then.end()) continue;
    found->second = FindFromRun(found->second, fit).value_or(found->second).string();
  }
  before.may_differ = kMayDiffer;
  before.may_differ.insert(kCallOptions.begin(), kCallOptions.end());
  before.instead = {"--steps", "--quality"};
  return ContinueWith(before, command, list);
}

Status StartOrGoOn(FitOptions* options, Command* command, CommandList* list) {
  if (options->resume) TILEGRAD_TRY(TakeFromFit(options->out, command, list));
  options->given = GivenOf(*command);
  for (const std::string& name : kCallOptions) options->given.erase(name);
  TILEGRAD_TRY(CheckResume(*options));
  if (options->input.empty())
    return InvalidArgument("fit: input is required; see tilegrad fit --help");
  return RunFitting(*options);
}

void AddWhat(Command* command, FitOptions* o) {
  command->Add(
      "input", &o->input,
      "folder with NeRF's transforms.json and images with alpha or masks; a COLMAP project; images "
      "alone, whose cameras are then estimated; or a dataset, with --model");
  command->Add("--model", &o->dataset_model, "CLASS/ID: a model of a tilegrad dataset");
  command->Add("--out", &o->out, "folder for mesh.glb, report.html, ...");
  AddForceOption(command, &o->force);
  command->Add("--start,--mesh", &o->start,
               "initial shape: hull (visual hull of the masks), sphere, a mesh file, or auto (the "
               "hull if masks and cameras allow). --mesh is the old name");
  command->Add("--optimize", &o->optimize,
               "what to fit: any of positions, colors, texture, uv, camera, light, sh, material, "
               "exposure, focal, separated by commas [positions and texture, or the colors that "
               "the initial mesh has]");
  command->Add("--material", &o->material,
               "unlit: lighting stays baked into the colors; lambert, phong: a light and its "
               "direction are fitted with the colors",
               {OneOf{{"unlit", "lambert", "phong"}}});
  command->Add("--lighting", &o->lighting, "none, lambert, phong or sh",
               {OneOf{{"none", "lambert", "phong", "sh"}}});
  command->Add("--light-direction", &o->light_direction,
               "direction towards the light, world axes: x y z", {Numbers{3}});
  command->Add("--cutout",
               Choice<train::Cutout>(&o->config.cutout, {{"off", train::Cutout::kOff},
                                                         {"auto", train::Cutout::kAuto},
                                                         {"on", train::Cutout::kOn}}),
               "for wire and thin leaves: a smooth surface whose texture has holes (alphaMode "
               "MASK); auto: where masks have many narrow gaps");
  command->Add("--filter", &o->filter, "texture lookup: bilinear or trilinear",
               {OneOf{{"bilinear", "trilinear"}}});
  command->Add("--truth", &o->truth, "ground-truth mesh to score against (3D IoU)");
  command->Add("--hold-out", &o->hold_out,
               "hold out every N-th image for evaluation; 0: those of transforms_test.json",
               {NotNegative()});
}

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
    const auto steps = train::StepsOfQuality(quality);
    if (steps.ok()) config->steps = *steps;
    return std::string();  // OneOf says what is wrong
  };
  command->Add("--quality", WordCheck{set_steps, ""},
               "fast, normal or best: 300, 1200 or 3000 steps",
               {OneOf{{"fast", "normal", "best"}}, Excludes{{"--steps"}}});
}

}  // namespace

void AddFit(CommandList* list) {
  const auto options = std::make_shared<FitOptions>();
  Command* const command = &list->emplace_back(
      Command{"fit", "Fit a mesh, texture, light or cameras to images by gradient descent"});
  command->action = [list, command, options] { return StartOrGoOn(options.get(), command, list); };
  AddWhat(command, options.get());
  AddPictureOptions(command, &options->pictures);
  AddNumbers(command, &options->config);
  command->Add("--rate", &options->rates, "learning rate, NAME=NUMBER (repeatable)",
               {SplitAtCommas{}});
  command->Add("--resume", &options->resume,
               "resume the fit in --out with the settings saved there; extend a finished one by a "
               "larger --steps",
               {Excludes{{"--force"}}});
  command->Add(
      "--doctor", &options->doctor,
      "fit nothing; report which parameters get a gradient at the start, and why others do not");
  AddLiveOption(command, &options->live);
  AddWorkersOption(command, &options->workers);
}

}  // namespace tilegrad::cli
