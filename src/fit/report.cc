// SPDX-License-Identifier: Apache-2.0
// The page about a fit: one file that needs nothing else.
#include "train/report/report.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/text.h"
#include "fit/run.h"
#include "train/losses/regularizers.h"
#include "train/report/html.h"
#include "train/run/log.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kShownViews = 6;

std::string Row(const std::string& name, const std::string& value) {
  return fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", EscapeHtml(name),
                     EscapeHtml(value));
}

std::string SentenceOf(const char* of, std::span<const ViewScore> views) {
  if (views.empty()) return "";
  return fmt::format(
      " {} have a mean PSNR of <b>{:.2f}\u00a0dB</b> and a silhouette IoU of <b>{:.1f}\u00a0%</b>.",
      of, MeanPsnr(views), 100 * MeanIou(views));
}

std::string Summary(const FitJob& job, const FitOutcome& o) {
  return fmt::format("Fitted to {} of {} × {} pixels in {} {} and {:.1f} seconds.{}{}",
                     Count(job.input.training.size(), "image"), job.input.images.width,
                     job.input.images.height, WithCommas(o.last_step),
                     Plural("step", o.last_step == 1), o.seconds,
                     SentenceOf("Renders of the fitted views", o.training),
                     SentenceOf("Renders of held-out views", o.held_out));
}

std::string Facts(const FitJob& job, const FitOutcome& o, const Mesh& mesh) {
  std::string out = Row("vertices", WithCommas(std::ssize(mesh.positions)));
  out += Row("faces", WithCommas(std::ssize(mesh.faces)));
  const bool cut_out = std::ranges::find(mesh.materials, AlphaMode::kMask, &Material::alpha_mode) !=
                       mesh.materials.end();
  for (const MeshTexture& texture : mesh.textures)
    out += Row("texture", fmt::format("{} × {} texels{}", texture.image.width, texture.image.height,
                                      cut_out ? ", cut out" : ""));
  if (mesh.textures.empty() && !mesh.colors.empty()) out += Row("colours", "one per vertex");
  out += Row("images fitted", WithCommas(std::ssize(job.input.training)));
  out += Row("images held out", WithCommas(std::ssize(job.input.held_out)));
  if (job.input.mask_agreement) {
    out += Row("masks", fmt::format("found in the images, in masks/; they agree to {:.0f} % with "
                                    "what all have in common",
                                    100 * *job.input.mask_agreement));
  }
  if (!o.doubt.empty()) out += Row("in doubt", o.doubt);
  if (o.voxel_iou)
    out += Row("3D IoU, 32 voxels a side", fmt::format("{:.1f} %", 100 * *o.voxel_iou));
  if (o.camera_error_before && o.camera_error_after) {
    out += Row("camera error", fmt::format("{:.2f}° at the start, {:.2f}° at the end",
                                           *o.camera_error_before, *o.camera_error_after));
  }
  return out;
}

std::string Gradients(const FitOutcome& o) {
  std::string out;
  for (const Finding& f : o.findings) out += Row(NameOf(f.parameter), f.sentence);
  return out;
}

Result<std::string> Figure(const ImageU8& image, const std::string& caption) {
  TILEGRAD_ASSIGN(const std::string address, PngAddress(image));
  return fmt::format(
      "<figure><img alt=\"{0}\" src=\"{1}\" width=\"{2}\" height=\"{3}\">"
      "<figcaption>{0}</figcaption></figure>\n",
      EscapeHtml(caption), address, image.width, image.height);
}

// The views that judge the fit.
std::span<const ViewScore> JudgedViews(const FitOutcome& o) {
  return o.held_out.empty() ? o.training : o.held_out;
}

std::string ViewsTitle(const FitOutcome& o) {
  const std::size_t all = JudgedViews(o).size();
  return fmt::format(
      "{} views{}", o.held_out.empty() ? "Fitted" : "Held-out",
      all > kShownViews ? fmt::format(", the first {} of {}", kShownViews, all) : "");
}

Result<std::string> Views(const FitJob& job, const FitOutcome& o) {
  const std::span<const ViewScore> scores = JudgedViews(o);
  std::string out;
  for (const ViewScore& s : scores.first(std::min(kShownViews, scores.size()))) {
    const std::string& name = job.input.names[static_cast<std::size_t>(s.view)];
    TILEGRAD_ASSIGN(const std::string truth, Figure(s.truth, name));
    const std::string score =
        fmt::format("PSNR {:.2f}\u00a0dB, IoU {:.1f}\u00a0%", s.psnr, 100 * s.iou);
    TILEGRAD_ASSIGN(const std::string rendered, Figure(s.rendered, score));
    out += "<div class=\"pair\">" + truth + rendered + "</div>\n";
  }
  return out;
}

Result<std::string> Timelapse(const ImageU8& sheet) {
  if (sheet.empty()) return std::string();
  TILEGRAD_ASSIGN(const std::string figure, Figure(sheet, "the first view over the run"));
  return "<section aria-labelledby=\"timelapse-heading\" class=\"sheet\">\n<h2 "
         "id=\"timelapse-heading\">Timelapse</h2>\n" +
         figure + "</section>\n";
}

std::string Setting(const std::string& name, const std::string& value, const char* meaning) {
  return fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td></tr>\n", EscapeHtml(name),
                     EscapeHtml(value), EscapeHtml(meaning));
}

// What each setting means beside its value: choices first, then the numbers.
std::string Settings(const FitJob& job) {
  static const std::map<std::string, const char*> kMeanings = {
      {"parameters", "fitted parameters"},
      {"material", "reflection model"},
      {"lighting", "lighting model"},
      {"light_direction", "direction towards the light, world axes"},
      {"start", "initial shape, unless a mesh was given"},
      {"mesh", "initial mesh, if given"},
      {"filter", "texture filter"},
      {"vertex_colors", "vertex colours instead of a texture"},
      {"max_alpha_error", "bound on the error of soft silhouettes"},
      {"rates", "learning rates of positions, colors, texture, uv, camera, light, sh, material"},
      {"rate_exposure", "learning rate of exposures"},
      {"rate_focal", "learning rate of focal lengths"},
      {"final_rate", "final fraction of these rates"}};
  std::string choices, numbers;
  FitConfig config = job.config;
  const ConfigFields fields = FieldsOf(&config);
  std::istringstream lines(DescribeJob(job));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find(" = ");
    const std::string key = line.substr(0, equals);
    const std::string value = line.substr(equals + 3);
    if (value.empty()) continue;  // parameters, where the input decides
    const auto choice = kMeanings.find(key);
    const auto field = std::ranges::find(fields, key, &ConfigField::key);
    if (choice != kMeanings.end()) choices += Setting(key, value, choice->second);
    if (field != fields.end()) numbers += Setting(key, value, field->help);
  }
  return choices + numbers;
}

}  // namespace

TermLabels FitLabels() {
  TermLabels out = RegularizerLabels();
  out.merge(TermLabels{{"color", "Colour loss (mean difference)"},
                       {"silhouette", "Silhouette loss"},
                       {"delta", "Softness of outlines (NDC²)"},
                       {"factor", "Downsampling of the images"},
                       {"images_per_second", "Images per second"}});
  return out;
}

Result<std::string> FitReport(const FitJob& job, const FitOutcome& outcome, const Mesh& mesh,
                              const ImageU8& sheet) {
  TILEGRAD_ASSIGN(const std::vector<LogEntry> log, ReadLog(job.out));
  TILEGRAD_ASSIGN(const std::string views, Views(job, outcome));
  TILEGRAD_ASSIGN(const std::string timelapse, Timelapse(sheet));
  nlohmann::ordered_json data = CurveData(log, FitLabels());
  const auto shown = CentredMeshJson(mesh);
  data["mesh"] = shown.ok() ? *shown : nullptr;  // of no extent
  const Path page = std::filesystem::absolute(job.out / "report.html").lexically_normal();
  return FillTemplate(kFitHtml, {{"name", EscapeHtml(page.parent_path().filename().string())},
                                 {"summary", Summary(job, outcome)},
                                 {"facts", Facts(job, outcome, mesh)},
                                 {"views_title", ViewsTitle(outcome)},
                                 {"views", views},
                                 {"timelapse", timelapse},
                                 {"gradients", Gradients(outcome)},
                                 {"settings", Settings(job)},
                                 {"data", ScriptJson(data)},
                                 {"style", std::string(kReportCss)},
                                 {"script", std::string(kPartsJs)}});
}

}  // namespace tilegrad::train
