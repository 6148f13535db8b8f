// SPDX-License-Identifier: Apache-2.0
#include "cli/fit_parameters.h"

#include <map>

#include "base/error.h"
#include "cli/option_words.h"

namespace tilegrad::cli {
namespace {

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

}  // namespace

Status ParseParameters(const std::string& text, train::ParameterSet* out) {
  for (const std::string& word : PartsBetweenCommas(text)) {
    TILEGRAD_ASSIGN(const Parameter p, ParameterNamed(word));
    (*out)[p] = true;
  }
  return {};
}

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

}  // namespace tilegrad::cli
