// SPDX-License-Identifier: Apache-2.0
// The critics of section 5.5.
#pragma once

#include "train/tasks/gan/config.h"
#include "train/tasks/learned_critic.h"

namespace tilegrad::train {

// Of silhouettes in all views, of their colours (D_I), of texture maps (D_t).
enum class GanCritic { kSilhouettes, kPictures, kTextures };

LearnedCritic::Job JobOf(const GanConfig& config, GanCritic critic);

}  // namespace tilegrad::train
