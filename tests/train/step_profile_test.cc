// SPDX-License-Identifier: Apache-2.0
#include "train/step_profile.h"

#include <gtest/gtest.h>

#include "same_run.h"
#include "support/temp_folder.h"
#include "tiny_run.h"

namespace tilegrad::train::step_profile_test {

class StepProfileTest : public TempFolderTest {
 protected:
  StepProfileTest() {
    Ok(WriteNoiseDataset(folder_ / "data"));
    auto config = Ok(ParseConfig(kTinyConfig, "tiny"));
    job_.config = std::move(config).value();
    job_.data = folder_ / "data";
    job_.config.schedule.steps = 4;
  }
  void Run(const std::string& name, const Workers& workers) {
    job_.run = folder_ / name;
    const auto outcome = Ok(Train(job_, workers, {}));
    EXPECT_TRUE(outcome->finished);
  }

  TrainJob job_;
};

TEST_F(StepProfileTest, ARecordedRunHasTheSameBits) {
  Run("one", Workers(1));
  LoopTrace trace;
  trace.Begin();
  Run("recorded", Workers(16, &trace));
  EXPECT_GT(trace.End().loops.size(), 100u);
  const Workers one(1);
  nn::Context context(one);
  ExpectSameBits(context, folder_ / "one", folder_ / "recorded", 4);
}

TEST_F(StepProfileTest, PredictsForEachNumberOfWorkersAndWritesNothing) {
  const auto profile = Ok(ProfileSteps(job_, {.steps = 2, .workers = {2, 16}}, {}));
  EXPECT_GT(profile->one, 0);
  EXPECT_GT(profile->all, 0);
  ASSERT_EQ(profile->forecasts.size(), 2u);
  for (const LoopForecast& forecast : profile->forecasts) {
    double taken = 0;
    bool draws = false;
    for (const HeldBack& place : forecast.places) {
      taken += place.taken;
      draws = draws || place.place.starts_with("render/pipeline/pipeline.cc:");
    }
    EXPECT_NEAR(taken, forecast.seconds, 1e-9);
    EXPECT_TRUE(draws);
  }
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) files += entry.exists();
  EXPECT_EQ(files, 1u);  // the dataset
}

TEST_F(StepProfileTest, Stops) {
  const StopFlag stop{true};
  EXPECT_EQ(ProfileSteps(job_, {.steps = 2, .workers = {2}}, {nullptr, &stop}).status().code(),
            StatusCode::kCancelled);
}

}  // namespace tilegrad::train::step_profile_test
