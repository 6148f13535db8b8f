// SPDX-License-Identifier: Apache-2.0
// Forward and backward of whole batches beside two references in the same process: the plain
// program with boxes (culled.h) and the naive one (reference.h), on synthetic scenes and on real
// furniture; and how time grows. `bench_report` makes tables and curves of the JSON.
//
// Names: scene/direction/what/who, who being a number of workers, `1-default` (one worker, the
// default max_alpha_error), `culled` or `naive`.
#include <benchmark/benchmark.h>

#include <cstdio>

#include "raster/furniture.h"
#include "raster/render_runs.h"
#include "start.h"

namespace tilegrad::bench {
namespace {

void AddOurs(const std::string& scene, const std::string& what, RunSpec spec) {
  for (const int workers : {1, 2}) {
    spec.workers = workers;
    AddRun({scene, what, std::to_string(workers)}, spec, Who::kRenderer);
  }
}

void AddBoth(const std::string& name, RunSpec spec) {
  AddRun({name, "both", "culled"}, spec, Who::kCulled);
  AddRun({name, "both", "naive"}, spec, Who::kNaive);
  AddOurs(name, "both", spec);
  spec.max_alpha_error = RenderOptions().max_alpha_error;
  AddRun({name, "both", "1-default"}, spec, Who::kRenderer);
}

void AddParts(const std::string& name, RunSpec spec) {
  for (const bool color : {true, false}) {
    const std::string what = color ? "color" : "alpha";
    spec.color = color;
    spec.alpha = !color;
    AddRun({name, what, "culled"}, spec, Who::kCulled);
    AddRun({name, what, "naive"}, spec, Who::kNaive);
    AddOurs(name, what, spec);
  }
}

void AddSphere(const SceneSpec& scene) {
  const RunSpec spec{scene};
  AddBoth(scene.name, spec);
  AddParts(scene.name, spec);
  RunSpec perspective = spec;
  perspective.interpolation = Interpolation::kPerspective;
  AddRun({scene.name, "perspective", "1"}, perspective, Who::kRenderer);
}

// Eight views of 256^2 of each.
void AddFurniture(const std::vector<FurnitureMesh>& furniture) {
  for (const FurnitureMesh& model : furniture) {
    SceneSpec scene{model.name.c_str(), 8, 256, 0};
    scene.mesh = &model.mesh;
    AddBoth(model.name, {scene});
    AddParts(model.name, {scene});
  }
}

}  // namespace
}  // namespace tilegrad::bench

int main(int argc, char** argv) {
  using namespace tilegrad::bench;
  if (!Start(&argc, argv)) return 1;
  for (const SceneSpec& scene : kScenes) AddSphere(scene);
  const auto furniture = LoadFurniture();
  if (furniture.ok()) {
    AddFurniture(furniture.value());
  } else {
    std::fprintf(stderr, "Furniture is left out: %s\n", furniture.status().message().c_str());
  }
  AddGrowthSeries();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
