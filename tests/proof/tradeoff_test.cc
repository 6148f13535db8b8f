// SPDX-License-Identifier: Apache-2.0
#include "proof/tradeoff.h"

#include <gtest/gtest.h>

#include "scene/camera.h"
#include "scene/shapes.h"
#include "support/expect.h"

namespace tilegrad::tradeoff_test {

struct SphereJob {
  std::vector<float> positions;
  std::vector<std::int32_t> faces;
  TradeoffJob job;

  SphereJob() {
    const Mesh mesh = Icosphere(2, 0.5f);
    for (const auto& p : mesh.positions) positions.insert(positions.end(), {p.x, p.y, p.z});
    for (const Face& f : mesh.faces) faces.insert(faces.end(), f.begin(), f.end());
    job.scene.positions = positions;
    job.scene.faces = faces;
    job.scene.camera = OrbitCamera({30.0, 32, 32}, 30, 20, 2.732);
    job.options.width = job.options.height = 32;
    job.errors = {0, 1e-4, 1e-1};
    job.repetitions = 1;
  }
};

const StopFlag kGo{false};

TEST(Tradeoff, ErrorsStayBelowWhatIsReportedAndWhatIsAsked) {
  SphereJob sphere;
  const auto result = Ok(MeasureTradeoff(sphere.job, {}, kGo));
  ASSERT_EQ(result->rows.size(), 4u);
  EXPECT_EQ(result->rows[3].rule, AlphaRule::kPaper);
  EXPECT_GT(result->rows[3].largest, 1e-3);  // it leaves out what is farther than its box
  EXPECT_EQ(result->faces, 320u);
  EXPECT_EQ(result->truth_rows, 32);
  EXPECT_EQ(result->image_rows, 32);
  EXPECT_GT(result->truth_forward_ms, 0);
  for (const TradeoffRow& row : result->rows) {
    // Rounding: screen coordinates carry 2^-24 * 32 pixels, 4 u of a kernel of 0.2 pixels at most.
    EXPECT_LE(row.largest, row.reported + 2e-5);
    EXPECT_LE(row.reported, row.max_alpha_error + 1e-30);
    EXPECT_LE(row.mean, row.largest);
    EXPECT_GT(row.forward_ms, 0);
    EXPECT_GT(row.backward_ms, 0);
  }
  EXPECT_LT(result->rows[0].gradient_error, 1e-4);
  EXPECT_LT(result->rows[0].gradient_angle, 1e-2);
  EXPECT_GT(result->rows[2].gradient_error, result->rows[0].gradient_error);
}

TEST(Tradeoff, EvenlySpreadRowsStandForTheWholeImage) {
  SphereJob sphere;
  sphere.job.truth_pairs = 8 * 32 * 320;
  const auto result = Ok(MeasureTradeoff(sphere.job, {}, kGo));
  EXPECT_EQ(result->truth_rows, 8);
  EXPECT_LT(result->rows[0].gradient_error, 1e-4);
}

TEST(Tradeoff, RefusesWhatHasNoAnswer) {
  SphereJob sphere;
  sphere.job.errors = {};
  EXPECT_FALSE(MeasureTradeoff(sphere.job, {}, kGo).ok());
  sphere.job.errors = {2};
  EXPECT_FALSE(MeasureTradeoff(sphere.job, {}, kGo).ok());
  sphere.job.errors = {0};
  const StopFlag stop{true};
  const auto stopped = MeasureTradeoff(sphere.job, {}, stop);
  EXPECT_EQ(stopped.status().code(), StatusCode::kCancelled);
  sphere.job.scene.camera = OrbitCamera({30.0, 32, 32}, 30, 20, -50);  // far behind the camera
  const auto nothing = MeasureTradeoff(sphere.job, {}, kGo);
  ExpectIn(nothing.status().message(), "no gradient");
}

}  // namespace tilegrad::tradeoff_test
