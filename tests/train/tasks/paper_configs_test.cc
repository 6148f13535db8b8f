// SPDX-License-Identifier: Apache-2.0
// The configurations of the paper's sections take twenty steps at their own sizes, but for the
// batch.
#include <gtest/gtest.h>

#include "support/temp_folder.h"
#include "train/config.h"
#include "train/data/photographs/miniature.h"
#include "train/tiny_run.h"
#include "train/trainer.h"

namespace tilegrad::train::paper_configs_test {

class PaperConfigs : public TempFolderTest {
 protected:
  // On a dataset of noise with `size` pixels a side; what it needs of other runs is in `settings`.
  void Run(const std::string& name, int size, std::vector<std::string> settings = {}) {
    SCOPED_TRACE(name);
    const Path data = folder_ / std::to_string(size);
    if (!PathExists(data)) {
      ASSERT_TRUE(WriteNoiseDataset(data, Meshes::kBoxes, /*classes=*/2, size).ok());
    }
    RunOn(data, name, std::move(settings));
  }
  void RunOn(const Path& data, const std::string& name, std::vector<std::string> settings = {}) {
    auto config = Ok(FindConfig(name));
    settings.insert(settings.end(), {"schedule.steps=20", "schedule.batch=2"});
    Ok(OverrideFields(settings, config->Fields()));
    TrainJob job;
    job.config = std::move(*config);
    job.data = data;
    job.run = folder_ / "runs" / name;
    const Workers workers(2);
    const StopFlag stop = false;
    const auto outcome = Ok(Train(job, workers, {}, stop));
    EXPECT_EQ(outcome->last_step, 20);
  }
  std::string Of(const std::string& key, const std::string& run) const {
    return key + "=" + (folder_ / "runs" / run).string();
  }
};

TEST_F(PaperConfigs, LongSection51) {
  for (const char* name : {"paper", "table1", "table1_free", "best"}) Run(name, 64);
}

TEST_F(PaperConfigs, LongSections52And53) {
  Run("table2", 128);
  Run("texture_paper", 256);
  Run("classify", 64);
  Run("texture_adversarial_paper", 256,
      {Of("start.run", "texture_paper"), Of("adversarial.network_file", "classify")});
}

TEST_F(PaperConfigs, LongSection54) {
  WriteMiniature(folder_ / "cub", "cub");
  for (const char* name : {"birds", "photographs_cmr"}) RunOn(folder_ / "cub", name);
}

// Both stages, and scores of eight objects.
TEST_F(PaperConfigs, LongSection55) {
  Run("texture_paper", 256);
  Run("gan_paper", 256,
      {Of("textures.run", "texture_paper"), "textures.count=8", "stages.shape=10", "score.every=20",
       "score.count=8"});
}

}  // namespace tilegrad::train::paper_configs_test
