// SPDX-License-Identifier: Apache-2.0
// When a fit hurries to its end, and that nobody can tell where it was interrupted.
#include "fit/clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fit/views_fixture.h"

namespace tilegrad::train::clock_test {

constexpr std::int64_t kWindow = FitClock::kWindow;

FitConfig Config(std::int64_t steps) {
  FitConfig config;
  config.steps = steps;
  config.levels = 1;
  return config;
}

// Steps until the end, if the loss is 0.9 of what it was each window until `flat`, then stays.
std::int64_t StepsOf(const FitConfig& config, std::int64_t flat) {
  FitClock clock(config);
  std::int64_t step = 0;
  double time = -1;
  for (; step < clock.End(); ++step) {
    EXPECT_GT(clock.At(step), time);
    time = clock.At(step);
    clock.Note(step, std::pow(0.9, static_cast<double>(std::min(step, flat) / kWindow)));
  }
  EXPECT_EQ(clock.At(step), 1);
  return step;
}

TEST(FitClock, HurriesFromWhereTheLossStays) {
  // Windows 0 to 5 fall, 6 is as 5: from step 700 on.
  EXPECT_EQ(StepsOf(Config(1000), 500), 700 + 100);
  EXPECT_EQ(StepsOf(Config(1001), 500), 700 + 101);  // a third, rounded up
  EXPECT_EQ(StepsOf(Config(1000), 1000), 1000);
  EXPECT_EQ(StepsOf(Config(150), 0), 150);  // too short for two windows
  FitConfig config = Config(1000);
  config.stop_gain = 0;
  EXPECT_EQ(StepsOf(config, 0), 1000);
  config = Config(1000);
  config.stop_gain = 0.2;
  EXPECT_EQ(StepsOf(config, 1000), 200 + 267);
}

TEST(FitClock, WaitsForFullResolutionAndForCameras) {
  FitConfig config = Config(1000);
  config.levels = 3;  // until step 550: windows end at 650, 750
  EXPECT_EQ(StepsOf(config, 0), 750 + 84);
  config.levels = 1;
  config.cameras_rest = 0.4;
  EXPECT_EQ(StepsOf(config, 0), 600 + 134);
}

class HurriedFit : public ViewsTest {
 protected:
  void SetUp() override { Views(ColoredBox(), {.views = 6, .held_out = 0, .size = 24}); }
  // Gets there in no time: from step 200 on it hurries.
  FitJob Job(const std::string& out) {
    FitJob job;
    job.input = Input();
    job.out = folder_ / out;
    job.config.start = StartShape::kHull;
    job.config.texture_size = 64;
    job.config.steps = 260;
    job.config.stop_gain = 1;
    job.config.checkpoint_every = 50;
    job.config.timelapse = 4;
    return job;
  }
  Bytes Read(const std::string& out) { return ReadFile(folder_ / out / "mesh.glb").value(); }
};

TEST_F(HurriedFit, StoppedAndResumedEndsInTheSameBitsForAnyWorkers) {
  FitJob job = Job("whole");
  const FitOutcome resumed = ExpectSameInParts(job, {70, 130, 207});
  EXPECT_TRUE(resumed.finished);
  EXPECT_EQ(resumed.last_step, 220);
  EXPECT_TRUE(std::filesystem::exists(job.out / "timelapse" / "00000220.png"));
  job.existing = ExistingRun::kContinue;
  EXPECT_EQ(Run(job)->first_step, 220);  // nothing is left to do
}

TEST_F(HurriedFit, AFinishedFitGoesOnWithMoreSteps) {
  for (const char* name : {"once", "parts"}) {
    FitJob job = Job(name);
    ASSERT_TRUE(Run(job, 1).ok());
    job.existing = ExistingRun::kContinue;
    job.config.steps = 300;
    if (name == std::string("parts")) {
      StopAt(job, 260);
      job.config.steps = 280;  // neither what it has now, nor what it had
      ExpectMessage(Run(job, 1).status(), "300 steps", "or more");
      job.config.steps = 300;
    }
    const auto more = Ok(Run(job));
    EXPECT_EQ(more->last_step, 300);
    // Pictures of both parts: 0, 87, 174 and 220; 200 and 300.
    EXPECT_TRUE(std::filesystem::exists(job.out / "timelapse" / "00000300.png"));
    job.config.steps = 260;
    ExpectMessage(Run(job, 1).status(), "300 steps already");
  }
  EXPECT_EQ(Read("once"), Read("parts"));
}

}  // namespace tilegrad::train::clock_test
