// SPDX-License-Identifier: Apache-2.0
#include "train/data/few_models.h"

#include <gtest/gtest.h>

namespace tilegrad::train::few_models_test {

std::vector<ModelInfo> Models(int training, int test) {
  std::vector<ModelInfo> out;
  for (int m = 0; m < training + test; ++m) {
    out.emplace_back().id = std::to_string(m);
    out.back().split = m < training ? Split::kTrain : Split::kTest;
  }
  return out;
}

TEST(FewModels, CountsShapesToTrainOn) {
  const int few = static_cast<int>(kFewShapes), streamed = static_cast<int>(kFewStreamedShapes);
  EXPECT_TRUE(AdviceOnFewModels(Models(few - 1, 100), false));
  EXPECT_FALSE(AdviceOnFewModels(Models(few, 0), false));
  EXPECT_TRUE(AdviceOnFewModels(Models(streamed - 1, 100), true));
  EXPECT_FALSE(AdviceOnFewModels(Models(streamed, 0), true));
  std::vector<ModelInfo> liveries = Models(few, 0);
  for (ModelInfo& model : liveries) model.shape = "one";
  EXPECT_TRUE(AdviceOnFewModels(liveries, false)->starts_with("1 training shape is few"));
}

TEST(FewModels, NamesTheRemedies) {
  const std::string fixed = *AdviceOnFewModels(Models(7, 2), false);
  for (const char* part : {"7 training shapes are few:", "--per-class", "stream.share=0.5",
                           "schedule.mirrored=0.5", "tilegrad fit"})
    EXPECT_NE(fixed.find(part), std::string::npos) << part << " is not in: " << fixed;
  const std::string streamed = *AdviceOnFewModels(Models(7, 2), true);
  EXPECT_EQ(streamed.find("stream.share"), std::string::npos) << streamed;
  EXPECT_NE(streamed.find("tilegrad fit"), std::string::npos) << streamed;
}

}  // namespace tilegrad::train::few_models_test
