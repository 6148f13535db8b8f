// SPDX-License-Identifier: Apache-2.0
// One input gives one output, bit by bit, for any number of workers, batched or one by one.

#include "base/hash.h"
#include "proof/selftest/check.h"
#include "proof/selftest/sphere_scene.h"
#include "render/renderer.h"

namespace tilegrad::selftest {
namespace {

// Three images of several bins and bands, the last ones partial; meshes of one and of many chunks.
std::vector<OwnedScene<float>> MakeBatch() {
  std::vector<OwnedScene<float>> scenes;
  for (const int level : {2, 4, 3}) {
    const auto seed = static_cast<std::uint64_t>(level);
    scenes.push_back(MakeSphere({.level = level, .width = 100, .height = 70, .seed = seed}));
  }
  return scenes;
}

struct Batch {
  std::vector<OwnedScene<float>> scenes = MakeBatch();
  OwnedCotangents<float> d_frame;  // of each image
  RenderOptions options = SphereOptions({.width = 100, .height = 70});

  Batch() {
    Rng rng(5, 23);
    d_frame = OwnedCotangents<float>(7000, 0, &rng);
  }
};

// The numbers of all images and gradients of a call, scene by scene.
using Bits = std::vector<std::vector<float>>;

// Image n of `count`.
template <class Image>
void AppendImage(const Image& images, std::size_t n, std::size_t count, std::vector<float>* out) {
  const std::size_t size = images.size() / count;
  out->insert(out->end(), images.begin() + static_cast<std::ptrdiff_t>(n * size),
              images.begin() + static_cast<std::ptrdiff_t>((n + 1) * size));
}

std::vector<float> BitsOf(const Images& frame, std::size_t n, std::size_t count,
                          OwnedScene<float>& d) {
  std::vector<float> out;
  AppendImage(frame.face_ids, n, count, &out);  // fewer than 2^24: exact
  for (const auto* image : {&frame.color, &frame.alpha, &frame.depth, &frame.normals, &frame.uv}) {
    AppendImage(*image, n, count, &out);
  }
  ForEachNumber(d, [&](const char*, float x) { out.push_back(x); });
  return out;
}

OwnedCotangents<float> Repeated(const OwnedCotangents<float>& one, std::size_t count) {
  OwnedCotangents<float> out;
  const auto repeat = [&](const char*, int, const auto& from, auto& to) {
    for (std::size_t n = 0; n < count; ++n) to.insert(to.end(), from.begin(), from.end());
  };
  ForEachImage(0, repeat, one, out);
  return out;
}

// Renders some scenes of the batch in one call.
Status RenderTogether(Batch& batch, std::span<OwnedScene<float>> scenes, const Workers& workers,
                      Bits* bits) {
  std::vector<Scene> views;
  std::vector<OwnedGradients<float>> gradients;
  std::vector<SceneGradients> d_scenes;
  gradients.reserve(scenes.size());  // views look at them
  for (auto& scene : scenes) {
    views.push_back(scene.View());
    d_scenes.push_back(gradients.emplace_back(scene).View());
  }
  const auto d_frame = Repeated(batch.d_frame, scenes.size());
  Renderer renderer = RendererOn(workers);
  Frame frame;
  TILEGRAD_TRY(renderer.Render(views, batch.options, ImagesWithGradients(), &frame));
  TILEGRAD_TRY(renderer.Backward(frame, d_frame.View(), d_scenes));
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    bits->push_back(BitsOf(frame.images(), n, scenes.size(), gradients[n].d));
  }
  return {};
}

Status ExpectBits(const CheckContext& context, Bits got, const Bits& want) {
  for (std::size_t n = 0; n < want.size(); ++n) {
    context.Take("bits", got[n]);
    TILEGRAD_TRY(
        ExpectSameBits("number", got[n], want[n]).Within(fmt::format("image and gradients {}", n)));
  }
  return {};
}

Result<Finding> SameForAnyWorkers(const CheckContext& context) {
  Batch batch;
  Bits first;
  for (const int count : {1, 2, 3, 7}) {
    const Workers workers(count);
    Bits together, single;
    TILEGRAD_TRY(RenderTogether(batch, batch.scenes, workers, &together));
    for (auto& scene : batch.scenes) {
      TILEGRAD_TRY(RenderTogether(batch, {&scene, 1}, workers, &single));
    }
    if (first.empty()) first = together;
    const std::string place = fmt::format("{} workers", count);
    TILEGRAD_TRY(ExpectBits(context, together, first).Within(place));
    TILEGRAD_TRY(ExpectBits(context, single, first).Within(place + ", one by one"));
  }
  Hash hash;
  for (const auto& numbers : first) hash.AddAll(numbers);
  return Finding{"1, 2, 3, 7 threads agree", 0, hash.Text().substr(0, 8)};
}

}  // namespace

std::vector<Check> SameBitsChecks() {
  return {OnEveryTarget({"same bits of images and gradients", SameForAnyWorkers})};
}

}  // namespace tilegrad::selftest
