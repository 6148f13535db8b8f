// SPDX-License-Identifier: Apache-2.0
#include "render/shading/report.h"

#include <fmt/format.h>

#include <utility>

namespace tilegrad {
namespace {

std::string NamesOf(const VaryingSet& set) {
  std::string out;
  for (std::size_t i = 0; i < kVaryings; ++i) {
    if (!set.has[i]) continue;
    out += (out.empty() ? "" : ", ") + std::string(StreamOf(Scene(), static_cast<Varying>(i)).name);
  }
  return out.empty() ? "nothing" : out;
}

const char* LightingName(Lighting lighting) {
  switch (lighting) {
    case Lighting::kNone:
      return "no light";
    case Lighting::kLambert:
      return "Lambert";
    case Lighting::kPhong:
      return "Phong";
    case Lighting::kSphericalHarmonics:
      return "spherical harmonics";
  }
  return "";
}

const char* NormalName(Normals kind) {
  switch (kind) {
    case Normals::kSmooth:
      return "smooth, from positions";
    case Normals::kFlat:
      return "flat, from positions";
    case Normals::kGiven:
      return "given by the scene";
  }
  return "";
}

// A stage that runs only if it is needed.
StageReport Only(std::string_view name, std::int64_t count, std::string_view unit, double ms,
                 std::string what, std::string_view spared) {
  return {name, count, unit, ms, count > 0 ? std::move(what) : std::string(spared)};
}

// Steps shared by both directions, after interpolation.
void AddShading(const SceneParts& parts, const ShadeWork& w, std::vector<StageReport>* out) {
  out->push_back(
      Only("gather", w.pixels, "pixels", w.gather, "foreground only", "attributes are the image"));
  out->push_back(Only("normalise", w.normals, "pixels", w.normal, "normals", "no normal needed"));
  out->push_back(Only("texture", w.lookups, "lookups", w.texture,
                      parts.trilinear ? "between levels" : "one level", "no texture needed"));
  const std::string light = LightingName(parts.shading.lighting);
  out->push_back(Only("light", w.lit, "pixels", w.light,
                      w.highlights > 0 ? light + " with highlight" : light, "nothing is lit"));
}

void AddScene(const SceneParts& parts, const SceneWork& w, std::vector<StageReport>* out) {
  out->push_back(Only("normals", w.normals, "faces", w.normals_ms,
                      NormalName(parts.shading.normals), "none computed"));
  out->push_back(Only("textures", w.texels, "texels", w.textures_ms,
                      parts.trilinear ? "with their levels" : "level 0 only", "none needed"));
}

// The rule, and its evaluation counts if it has any.
std::string Evaluated(const RenderStats& stats, std::string_view where = "") {
  if (stats.pairs == 0) return fmt::format("{}{}", stats.alpha_rule, where);
  return fmt::format("{}{}: {} pairs of face and pixel, {} exponentials", stats.alpha_rule, where,
                     stats.pairs, stats.powers);
}

std::int64_t Numbers(const ShadeWork& shade, const VaryingSet& set) {
  return shade.pixels * set.channels();
}

}  // namespace

PlanReport ReportForward(const ForwardPlan& plan, const CallWork& work) {
  const ShadeWork& shade = work.shade;
  PlanReport report{false, {}};
  auto& out = report.stages;
  AddScene(plan.parts, work.scene, &out);
  out.push_back(Only("pack", work.scene.packed, "numbers", work.scene.pack_ms,
                     NamesOf(plan.varyings), "attributes are used as they are"));
  out.push_back(Only("prepare", work.stats.prepared, "images", work.times.prepare,
                     "project, clip, bin", "nothing to do"));
  out.push_back(
      Only("visibility", work.stats.drawn, "bins", work.times.visibility, "face ids", "no image"));
  out.push_back(Only("interpolate", work.stats.interpolated, "bins", work.times.interpolate,
                     NamesOf(plan.varyings), "no image needs attributes"));
  AddShading(plan.parts, shade, &out);
  out.push_back(Only("combine", plan.steps.color ? shade.pixels : 0, "pixels", shade.color,
                     "equation 7", "no colour is computed"));
  out.push_back(Only("scatter", shade.pixels, "pixels", shade.scatter, "into images",
                     "attributes are the image"));
  out.push_back(Only("alpha", work.stats.alpha_parts, "bins", work.times.alpha,
                     Evaluated(work.stats), "alpha is not requested"));
  return report;
}

PlanReport ReportBackward(const BackwardPlan& plan, const CallWork& work) {
  const ShadeWork& shade = work.shade;
  PlanReport report{true, {}};
  auto& out = report.stages;
  AddScene(plan.parts, work.scene, &out);
  out.push_back(Only("pack", work.scene.packed, "numbers", work.scene.pack_ms, NamesOf(plan.pulled),
                     "attributes are used as they are"));
  out.push_back(Only("prepare", work.stats.prepared, "images", work.times.prepare, "project, clip",
                     "kept from the forward pass"));
  out.push_back(Only("recompute", Numbers(shade, plan.recomputed), "numbers",
                     work.times.interpolate, NamesOf(plan.recomputed), "no value is recomputed"));
  AddShading(plan.parts, shade, &out);
  out.push_back(Only("adjoint", shade.pixels, "pixels", shade.adjoint, "to " + NamesOf(plan.pulled),
                     "attributes are the image"));
  out.push_back(Only("scatter", Numbers(shade, plan.pulled), "numbers", shade.scatter,
                     NamesOf(plan.pulled), "no attribute has a gradient"));
  out.push_back(Only("gradients", plan.pulled.channels() > 0 ? work.stats.interpolated : 0, "bands",
                     work.times.gradients,
                     plan.geometry ? "of attributes and geometry" : "of attributes",
                     "no attribute has a gradient"));
  out.push_back(Only("alpha", work.stats.alpha_parts, "bins", work.times.alpha,
                     Evaluated(work.stats, ", to geometry"), "alpha has no gradient"));
  out.push_back(Only("merge", work.stats.merged, "arrays", work.times.merge + work.scene.merge_ms,
                     "from faces to the scene", "nothing to merge"));
  return report;
}

std::int64_t PlanReport::count(std::string_view name) const {
  for (const StageReport& s : stages) {
    if (s.name == name) return s.count;
  }
  return 0;
}

std::vector<std::string> ExplainLines(const PlanReport& report) {
  std::vector<std::string> out = {report.backward ? "backward" : "forward"};
  for (const StageReport& s : report.stages) {
    if (s.count > 0) {
      out.push_back(fmt::format("  {:<12} {:>11} {:<8} {:>9.3f} ms  {}", s.name, s.count, s.unit,
                                s.milliseconds, s.what));
    } else {
      out.push_back(fmt::format("  {:<12} {:>11} {:<8} {:>12}  {}", s.name, "-", "", "", s.what));
    }
  }
  return out;
}

}  // namespace tilegrad
