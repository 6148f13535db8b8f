// SPDX-License-Identifier: Apache-2.0
// The rules that alpha can be made by, and which of them the options choose.
#pragma once

#include <cstddef>

#include "render/alpha/all_faces.h"
#include "render/alpha/paper.h"

namespace tilegrad {

class AlphaRules {
 public:
  explicit AlphaRules(std::size_t workers) : all_faces_(workers) {}

  AlphaStage* Of(AlphaRule rule) {
    switch (rule) {
      case AlphaRule::kAllFaces:
        return &all_faces_;
      case AlphaRule::kPaper:
        return &paper_;
    }
    return nullptr;
  }

 private:
  AllFacesAlpha all_faces_;
  PaperAlpha paper_;
};

}  // namespace tilegrad
