// SPDX-License-Identifier: Apache-2.0
// The vector kernels against the references, over scenes that an input describes: within the
// tolerance that the references state themselves (raster/extremes/truth.h), and the same bits from
// one thread and from two.
#include <cstring>
#include <string>

#include "fuzz/numbers.h"
#include "fuzz/target.h"
#include "proof/owned_scene.h"
#include "raster/extremes/truth.h"
#include "render/trial.h"

namespace tilegrad::fuzz::kernel_targets {

// A coordinate: mostly of the image, at steps of 1/256 pixel; else any float.
float Coordinate(Numbers* in, int size) {
  if (in->Below(8) != 0)
    return static_cast<float>(in->Take<std::int16_t>()) / 256 + 0.5f * static_cast<float>(size);
  const auto any = in->Take<float>();
  return std::isfinite(any) ? any : 0;
}

test::ExtremeScene SceneOf(Numbers* in) {
  constexpr double kDeltas[] = {1.0 / 7000, 1e-3, 1e-2, 1, 1e-6, 1e-12, 1e6};
  constexpr double kErrors[] = {0, 1e-6, 1e-4, 1e-2, 1};
  test::ExtremeScene e;
  e.kind = "fuzzed";
  RenderOptions& o = e.options;
  o.width = 1 + static_cast<int>(in->Below(20));
  o.height = 1 + static_cast<int>(in->Below(20));
  o.delta = kDeltas[in->Below(7)];
  o.max_alpha_error = kErrors[in->Below(5)];
  o.interpolation = in->Below(2) == 0 ? Interpolation::kPerspective : Interpolation::kScreenLinear;
  o.culling = in->Below(4) == 0 ? FaceCulling::kBack : FaceCulling::kNone;
  e.scene.camera = {.fx = 1, .fy = 1, .cx = 0, .cy = 0, .near_plane = 0.1f};  // pixels are world
  const std::uint32_t vertices = 1 + in->Below(12), faces = in->Below(16);
  for (std::uint32_t v = 0; v < vertices; ++v) {
    const float x = Coordinate(in, o.width), y = Coordinate(in, o.height);
    const float depth = in->Below(4) == 0 ? in->Take<float>() : 1;
    const float d = std::isfinite(depth) ? depth : 1;
    e.scene.positions.insert(e.scene.positions.end(), {x, -y, -d});
  }
  for (std::uint32_t k = 0; k < 3 * faces; ++k) {
    e.scene.faces.push_back(static_cast<std::int32_t>(in->Below(vertices)));
  }
  Rng rng(in->Take<std::uint8_t>(), 3);
  test::RandomAttributes(static_cast<int>(in->Below(4)),
                         in->Below(2) == 0 ? Rate::kVertex : Rate::kCorner, &rng, &e.scene);
  return e;
}

// Visibility, interpolation, alpha and all gradients.
void Raster(Input input) {
  static const Workers one(1);
  Numbers in(input);
  const TargetScope scope(TargetOf(&in));
  Require(scope.status().ok(), "a target can be chosen");
  Renderer renderer = RendererOn(one);
  const std::uint64_t number = in.Take<std::uint16_t>();
  const test::ExtremeScene scene = SceneOf(&in);
  test::CheckCounts counts;
  const std::string wrong = test::CheckExtremeScene(scene, number, &renderer, &counts);
  Require(wrong.empty(), "kernels agree with the reference: " + wrong);
}

template <class T>
bool SameBits(const T& a, const T& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
}

// Every shading model, textures of all kinds: one thread and two give the same images and
// gradients.
void Threads(Input input) {
  static const Workers one(1), two(2);
  Numbers in(input);
  const TargetScope scope(TargetOf(&in));
  Require(scope.status().ok(), "a target can be chosen");
  const auto& recipe =
      test::kRecipes[in.Below(static_cast<std::uint32_t>(std::size(test::kRecipes)))];
  test::Trial trial(recipe, in.Take<std::uint16_t>());
  for (float& p : trial.scene.mesh.positions) {
    if (!in.empty()) p += static_cast<float>(in.Take<std::int8_t>()) / 64;
  }
  OwnedRendering<float> first, second;
  const RenderOptions options = test::TrialOptions();
  const auto d = trial.d_frame.template Cast<float>();
  auto scene = trial.scene;
  const Status a = RenderOwned(trial.scene, options, test::EveryImage(), d, one, &first);
  const Status b = RenderOwned(scene, options, test::EveryImage(), d, two, &second);
  Require(a.ok() == b.ok(), "one thread and two have the same outcome");
  if (!a.ok()) return;
  Require(SameBits(first.frame.face_ids, second.frame.face_ids), "the same faces");
  Require(SameBits(first.frame.color, second.frame.color), "the same colours");
  Require(SameBits(first.frame.alpha, second.frame.alpha), "the same alpha");
  Require(SameBits(first.frame.depth, second.frame.depth), "the same depth");
  std::vector<float> one_thread, two_threads;
  ForEachNumber(first.d, [&](const char*, float& x) { one_thread.push_back(x); });
  ForEachNumber(second.d, [&](const char*, float& x) { two_threads.push_back(x); });
  Require(SameBits(one_thread, two_threads), "the same gradients");
  for (const float x : one_thread) Require(std::isfinite(x), "finite gradients");
}

const Registration kTargets[] = {
    Registration({"raster", Raster, RandomSeeds<8, 150>}),
    Registration({"threads", Threads, RandomSeeds<8, 150>}),
};

}  // namespace tilegrad::fuzz::kernel_targets
