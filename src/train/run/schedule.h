// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

#include "train/run/config_fields.h"

namespace tilegrad::train {

// How long a run is, and what it leaves behind on the way.
struct Schedule {
  std::int64_t steps = 50000;
  std::int64_t seed = 1;        // of everything that is random
  std::int64_t portions = 1;    // of a batch, run/portion.h
  std::int64_t log_every = 20;  // steps
  std::int64_t sample_every = 1000;
  std::int64_t checkpoint_every = 500;
  std::int64_t keep_checkpoints = 3;  // the newest ones
};

// Whether a sample sheet is due after `steps` steps: every `sample_every`, at the end, and before
// that after 10, 20, 40, ..., so that who waits for a slow task soon sees something, too.
inline bool SampleIsDue(const Schedule& s, std::int64_t steps) {
  if (steps <= 0) return false;
  if (steps % s.sample_every == 0 || steps == s.steps) return true;
  const bool early = steps % 10 == 0 && std::has_single_bit(static_cast<std::uint64_t>(steps / 10));
  return early && steps < s.sample_every;
}

// Its keys, in table [schedule].
inline ConfigFields FieldsOf(Schedule* s) {
  const auto reporting = Affects::kReporting;
  return {{"schedule.steps", &s->steps, 1, kNoLimit, "number of training steps"},
          {"schedule.seed", &s->seed, 0, kNoLimit, "seed of weights, order and views"},
          {"schedule.portions", &s->portions, 1, 1 << 20,
           "portions of a batch, each computed independently, for up to as many processes; a power "
           "of two"},
          {"schedule.log_every", &s->log_every, 1, kNoLimit, "steps", reporting},
          {"schedule.sample_every", &s->sample_every, 1, kNoLimit,
           "steps between samples; the first ones are at 10, 20, 40 and so on", reporting},
          {"schedule.checkpoint_every", &s->checkpoint_every, 1, kNoLimit, "steps", reporting},
          {"schedule.keep_checkpoints", &s->keep_checkpoints, 1, kNoLimit,
           "number of newest checkpoints to keep", reporting}};
}

}  // namespace tilegrad::train
