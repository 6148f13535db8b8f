// SPDX-License-Identifier: Apache-2.0
// What each request costs: silhouette, colour, texture, Lambert, Phong and spherical harmonics,
// forward and backward, on the spheres of bench_scenes.h. One worker.
//
// Names: scene/direction/request/shaded. Requests but `silhouette` ask for colour and alpha;
// gradients go to positions and to everything that gives the request its colour.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>
#include <vector>

#include "base/rng.h"
#include "raster/bench_scenes.h"
#include "render/renderer.h"
#include "start.h"

namespace tilegrad::bench {
namespace {

struct RequestSpec {
  const char* name;
  bool color = true, textured = false;
  Filter filter = Filter::kBilinear;
  Lighting lighting = Lighting::kNone;
  float scale = 1;  // of colours
};

constexpr RequestSpec kRequests[] = {
    {"silhouette", false},
    {"color"},
    // So large that images may leave float's range: what looking through them costs.
    {"large color", true, false, Filter::kBilinear, Lighting::kNone, 0x1p21f},
    {"texture", true, true},
    {"trilinear texture", true, true, Filter::kTrilinear},
    {"Lambert", true, false, Filter::kBilinear, Lighting::kLambert},
    {"Phong", true, false, Filter::kBilinear, Lighting::kPhong},
    {"harmonics", true, false, Filter::kBilinear, Lighting::kSphericalHarmonics},
    {"texture and Phong", true, true, Filter::kBilinear, Lighting::kPhong},
};

constexpr int kTextureSize = 256;

// Everything that a batch of one request reads and writes.
class ShadedBatch {
 public:
  ShadedBatch(const SceneSpec& spec, const RequestSpec& request)
      : batch_(spec), request_spec_(request) {
    batch_.options.interpolation = Interpolation::kPerspective;
    request_.color = request.color;
    request_.attributes = false;
    Rng rng(11, 2);
    Fill(2 * batch_.positions[0].size() / 3, &rng, &uvs_);
    Fill(3 * kTextureSize * kTextureSize, &rng, &texels_);
    texture_ = {texels_, kTextureSize, kTextureSize, Wrap::kRepeat, request.filter};
    d_texture_.resize(texels_.size());
    d_uvs_.resize(uvs_.size());
    d_texture_views_ = {d_texture_};
    d_colors_.resize(batch_.colors.size());
    for (float& color : batch_.colors) color *= request.scale;
    for (std::size_t n = 0; n < batch_.scenes.size(); ++n) AddScene(n);
    if (request.color) d_frame_.color = batch_.d_attributes;
    d_frame_.alpha = batch_.d_alpha;
  }

  Status Forward() { return renderer_.Render(scenes_, batch_.options, request_, &frame_); }
  Status Backward() { return renderer_.Backward(frame_, d_frame_, d_scenes_); }

 private:
  static void Fill(std::size_t count, Rng* rng, std::vector<float>* out) {
    out->resize(count);
    for (float& v : *out) v = static_cast<float>(rng->Uniform());
  }

  void AddScene(std::size_t n) {
    Scene scene = batch_.scenes[n];
    scene.attributes = {};
    scene.channels = 0;
    SceneGradients d;
    d.positions = batch_.d_positions[n];
    if (request_spec_.textured) {
      scene.uvs = {uvs_, Rate::kVertex};
      scene.textures = {&texture_, 1};
      d.uvs = d_uvs_;
      d.textures = d_texture_views_;
    } else if (request_spec_.color) {
      scene.colors = {batch_.colors, Rate::kVertex};
      d.colors = d_colors_;
    }
    scene.shading.lighting = request_spec_.lighting;
    if (request_spec_.lighting == Lighting::kSphericalHarmonics) {
      scene.sh = sh_;
      d.sh = d_sh_;
    } else if (request_spec_.lighting != Lighting::kNone) {
      scene.lights = lights_;
      d.lights = d_lights_;
      d.surfaces = d_surfaces_;
    }
    scenes_.push_back(scene);
    d_scenes_.push_back(d);
  }

  BenchBatch batch_;
  RequestSpec request_spec_;
  Outputs request_;
  std::vector<float> uvs_, texels_, d_uvs_, d_texture_, d_colors_;
  Texture texture_;
  std::vector<std::span<float>> d_texture_views_;
  std::vector<float> sh_ = {1, 0.5f, 0.2f, 0.1f, 0.1f, 0.2f, 0.3f, 0.1f, 0.1f};
  std::vector<float> d_sh_ = std::vector<float>(9);
  std::vector<Light> lights_ = {{{1, 1, 1}, 1}};
  std::vector<Light> d_lights_ = {{}};
  std::vector<Surface> d_surfaces_ = std::vector<Surface>(1);
  std::vector<Scene> scenes_;
  std::vector<SceneGradients> d_scenes_;
  FrameGradients d_frame_;
  Workers workers_{1};
  Renderer renderer_ = RendererOn(workers_);
  Frame frame_;
};

void Run(benchmark::State& state, const SceneSpec& scene, const RequestSpec& request,
         bool backward) {
  ShadedBatch batch(scene, request);
  Status status = batch.Forward();
  if (backward && status.ok()) status = batch.Backward();
  for (auto _ : state) {
    if (status.ok()) status = backward ? batch.Backward() : batch.Forward();
  }
  if (!status.ok()) state.SkipWithError(status.message().c_str());
}

}  // namespace
}  // namespace tilegrad::bench

int main(int argc, char** argv) {
  using namespace tilegrad::bench;
  if (!Start(&argc, argv)) return 1;
  for (const SceneSpec& scene : kScenes) {
    if (scene.name != std::string("S1") && scene.name != std::string("S2")) continue;
    for (const RequestSpec& request : kRequests) {
      for (const bool backward : {false, true}) {
        const std::string name = std::string(scene.name) + (backward ? "/backward/" : "/forward/") +
                                 request.name + "/shaded";
        benchmark::RegisterBenchmark(name.c_str(), [&scene, &request,
                                                    backward](benchmark::State& state) {
          Run(state, scene, request, backward);
        })->Unit(benchmark::kMillisecond);
      }
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
