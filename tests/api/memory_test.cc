// SPDX-License-Identifier: Apache-2.0
// Memory: none is allocated in the steady state, and none that is refused gets past a Status.
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <vector>

#include "api/test_scene.h"
#include "base/sanitizers.h"
#include "support/allocation_count.h"

namespace tilegrad::memory_test {

using test::g_allocations;
using test::g_refused;
using test::kAll;
using test::kTestOptions;
using test::TestCotangents;
using test::TestGradients;
using test::TestScene;

// A step of a training loop over two scenes.
class Step {
 public:
  explicit Step(Lighting lighting, const RenderOptions& options)
      : test_(lighting), options_(options), scenes_(2, test_.scene), g_(test_), d_scenes_(2, g_.d) {
    Renderer renderer;
    EXPECT_TRUE(renderer.Render(scenes_, options_, kAll, &frame_).ok());
    cotangents_ = std::make_unique<TestCotangents<float>>(frame_.images());
  }

  Status Run(Renderer* renderer, Frame* frame) {
    TILEGRAD_TRY(renderer->Render(scenes_, options_, kAll, frame));
    TILEGRAD_TRY(renderer->Backward(*frame, cotangents_->d, d_scenes_));
    return renderer->Backward(*frame, cotangents_->d, d_scenes_, GradientMode::kAdd);
  }

 private:
  TestScene<float> test_;
  RenderOptions options_;
  std::vector<Scene> scenes_;
  TestGradients<float> g_;
  std::vector<SceneGradients> d_scenes_;
  Frame frame_;
  std::unique_ptr<TestCotangents<float>> cotangents_;
};

// With several threads the scratch of each grows until it has met the largest tile.
bool IsSteadySoon(Step* step, Renderer* renderer, Frame* frame) {
  for (int i = 0, quiet = 0; i < 100; ++i) {
    const long before = g_allocations;
    EXPECT_TRUE(step->Run(renderer, frame).ok());
    quiet = g_allocations == before ? quiet + 1 : 0;
    if (quiet == 10) return true;
  }
  return false;
}

TEST(ApiMemory, SeveralThreadsSoonAllocateNothing) {
  if (kThreadSanitizer) GTEST_SKIP() << "which allocates itself";
  RenderOptions options = kTestOptions;
  options.width = options.height = 150;
  Step step(Lighting::kPhong, options);
  for (const int threads : {2, 3}) {
    Renderer renderer{{.threads = threads}};
    Frame frame;
    EXPECT_TRUE(IsSteadySoon(&step, &renderer, &frame)) << threads;
  }
}

TEST(ApiMemory, SteadyStateAllocatesNothing) {
  for (const Lighting lighting :
       {Lighting::kNone, Lighting::kPhong, Lighting::kSphericalHarmonics}) {
    for (const int size : {34, 150}) {
      RenderOptions options = kTestOptions;
      options.width = options.height = size;
      Step step(lighting, options);
      Renderer renderer{{.threads = 1}};
      Frame frame;
      const long before_first = g_allocations;
      ASSERT_TRUE(step.Run(&renderer, &frame).ok());
      EXPECT_GT(g_allocations, before_first);  // the counter counts
      const long before = g_allocations;
      for (int i = 0; i < 3; ++i) ASSERT_TRUE(step.Run(&renderer, &frame).ok());
      EXPECT_EQ(g_allocations - before, 0) << static_cast<int>(lighting) << ", " << size;
    }
  }
}

// Wherever memory ends, the call says so, and the same renderer goes on when there is some again.
TEST(ApiMemory, NoMemoryIsAnErrorLikeOthers) {
  Step step(Lighting::kPhong, kTestOptions);
  long refused = 0;
  for (long at = 0;; ++at) {
    Renderer renderer{{.threads = 1}};
    Frame frame;
    g_refused = g_allocations + at;
    const Status status = step.Run(&renderer, &frame);
    g_refused = std::numeric_limits<long>::max();
    if (status.ok()) break;
    ++refused;
    ASSERT_EQ(status.code(), StatusCode::kResourceExhausted) << at;
    ASSERT_TRUE(step.Run(&renderer, &frame).ok()) << at;
  }
  EXPECT_GT(refused, 50);
}

TEST(ApiMemory, GradientsStayAsTheyWereWhereMemoryEndsWhenAdding) {
  const TestScene<float> s(Lighting::kPhong);
  Renderer renderer{{.threads = 1}};
  Frame frame;
  ASSERT_TRUE(renderer.Render({&s.scene, 1}, kTestOptions, kAll, &frame).ok());
  const TestCotangents<float> cotangents(frame.images());
  TestGradients<float> g(s, 2.0f);
  const std::vector<float> before = g.positions;
  for (long at = 0; g.positions == before; ++at) {
    Renderer fresh{{.threads = 1}};
    g_refused = g_allocations + at;
    const Status status = fresh.Backward(frame, cotangents.d, {&g.d, 1}, GradientMode::kAdd);
    g_refused = std::numeric_limits<long>::max();
    ASSERT_EQ(status.ok(), g.positions != before) << at;
  }
}

}  // namespace tilegrad::memory_test
