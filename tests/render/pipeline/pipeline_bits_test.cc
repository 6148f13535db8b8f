// SPDX-License-Identifier: Apache-2.0
// The renderer's bits: the same for any number of workers, any run, batched or one by one.
#include <gtest/gtest.h>

#include <string>

#include "render/pipeline/pipeline.h"
#include "render/pipeline/test_batch.h"

namespace tilegrad::pipeline_bits_test {

using test::Batch;
using test::Options;

// Everything a forward and a backward pass put out, as bytes.
std::string Bytes(Pipeline* renderer, Batch* batch, std::size_t first, std::size_t count) {
  PipelineFrame frame;
  const auto views = std::span(batch->views).subspan(first, count);
  const auto d_scenes = std::span(batch->d_scenes).subspan(first, count);
  const auto part = [&](const std::vector<float>& values) {
    const std::size_t one = values.size() / batch->views.size();
    return std::span<const float>(values).subspan(first * one, count * one);
  };
  EXPECT_TRUE(
      renderer->Render(views, batch->options, {.depth = true, .barycentrics = true}, &frame).ok());
  EXPECT_TRUE(renderer
                  ->Backward(views, batch->options, frame,
                             {part(batch->d_attributes), part(batch->d_alpha)}, d_scenes)
                  .ok());
  std::string out;
  const auto add = [&](const auto& values) {
    out.append(reinterpret_cast<const char*>(std::data(values)),
               std::size(values) * sizeof(*std::data(values)));
  };
  for (std::size_t n = 0; n < count; ++n) {
    const auto image = [&](const auto& values) {
      add(std::span(values).subspan(n * values.size() / count, values.size() / count));
    };
    image(frame.face_ids);
    image(frame.attributes);
    image(frame.alpha);
    image(frame.depth);
    image(frame.barycentrics);
    add(d_scenes[n].positions);
    add(d_scenes[n].attributes);
    add(d_scenes[n].d_camera.rotation);
    add(d_scenes[n].d_camera.translation);
    const CameraT<float>& d_camera = d_scenes[n].d_camera;
    add(std::vector<float>{d_camera.fx, d_camera.fy, d_camera.cx, d_camera.cy});
  }
  return out;
}

void ExpectSameForAnyWorkerCount(Batch batch) {
  std::string first;
  for (const int count : {1, 2, 3, 7, 16}) {
    const Workers workers(count);
    Pipeline renderer(workers);
    for (int run = 0; run < 3; ++run) {
      const std::string bytes = Bytes(&renderer, &batch, 0, batch.scenes.size());
      if (first.empty()) first = bytes;
      EXPECT_TRUE(bytes == first) << count << " workers, run " << run;
    }
  }
}

TEST(RendererBits, SameForAnyWorkerCountAndAnyRun) { ExpectSameForAnyWorkerCount(Batch()); }

TEST(RendererBits, SameForAnyWorkerCountWhereImagesAreShared) {
  ExpectSameForAnyWorkerCount(Batch::Large());
}

void ExpectSameBatchedAndOneByOne(Batch batch) {
  for (const int count : {1, 2, 3, 7, 16}) {
    const Workers workers(count);
    Pipeline renderer(workers);
    const std::string together = Bytes(&renderer, &batch, 0, batch.scenes.size());
    std::string single;
    for (std::size_t n = 0; n < batch.scenes.size(); ++n) single += Bytes(&renderer, &batch, n, 1);
    EXPECT_TRUE(together == single) << count << " workers";
  }
}

TEST(RendererBits, SameBatchedAndOneByOne) { ExpectSameBatchedAndOneByOne(Batch()); }

TEST(RendererBits, SameBatchedAndOneByOneWhereImagesAreShared) {
  ExpectSameBatchedAndOneByOne(Batch::Large());
}

// Backward may reuse what Render prepared, but only for the same scenes and options.
TEST(RendererBits, BackwardDoesNotDependOnWhatWasRenderedLast) {
  Batch batch;
  const Workers workers(1);
  Pipeline renderer(workers);
  PipelineFrame frame, other;
  const auto backward = [&] {
    return renderer.Backward(batch.views, Options(), frame, {batch.d_attributes, batch.d_alpha},
                             batch.d_scenes);
  };
  ASSERT_TRUE(renderer.Render(batch.views, Options(), {}, &frame).ok());
  ASSERT_TRUE(backward().ok());
  const auto expected = batch.positions;
  const auto check_after = [&](const RenderOptions& options, const char* what) {
    ASSERT_TRUE(renderer.Render(batch.views, options, {}, &other).ok());
    batch = Batch();  // the scenes as they were, at other addresses
    ASSERT_TRUE(backward().ok());
    EXPECT_EQ(batch.positions, expected) << what;
  };
  batch.scenes[0].positions[4] += 0.05f;
  check_after(Options(), "a vertex moved");
  std::swap(batch.scenes[1].faces[0], batch.scenes[1].faces[1]);
  check_after(Options(), "a face turned");
  batch.views[2].camera.fx += 3;
  check_after(Options(), "another camera");
  RenderOptions wide = Options();
  wide.delta = 0.1;
  check_after(wide, "another kernel");
}

}  // namespace tilegrad::pipeline_bits_test
