// SPDX-License-Identifier: Apache-2.0
// The words of tilegrad fit that name what is fitted. Errors say which word, and what there is.
#pragma once

#include <string>

#include "fit/config.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

// "positions,texture"
Status ParseParameters(const std::string& text, train::ParameterSet* out);

// "positions=0.01", of a parameter in `fitted`; none there: those that are fitted by default.
Status ParseRate(const std::string& text, const train::ParameterSet& fitted,
                 train::LearningRates* rates);

// Of --material and --lighting, words that were checked.
void SetMaterialAndLighting(const std::string& material, const std::string& lighting,
                            train::FitConfig* config);

}  // namespace tilegrad::cli
