// SPDX-License-Identifier: Apache-2.0
// What suites of fits share: views of a mesh in a folder, fits of them, and how masks compare.
#pragma once

#include <span>
#include <string>

#include "fit/make_views.h"
#include "fit/run.h"
#include "io/mesh_file.h"
#include "scene/shapes.h"
#include "support/temp_folder.h"

namespace tilegrad::train {

inline Mesh ColoredBox(glm::vec4 color = {0.8f, 0.4f, 0.2f, 1}) {
  Mesh box = Box({0, 0, 0}, {0.8f, 0.6f, 0.7f});
  SetColor(box, color);
  return box;
}

// Intersection over union of pixels that are covered by a half or more.
inline double MaskIou(std::span<const float> a, std::span<const float> b) {
  EXPECT_EQ(a.size(), b.size());
  double both = 0, either = 0;
  for (std::size_t p = 0; p < a.size(); ++p) {
    both += a[p] >= 0.5f && b[p] >= 0.5f;
    either += a[p] >= 0.5f || b[p] >= 0.5f;
  }
  return both / either;
}

class ViewsTest : public TempFolderTest {
 protected:
  // The input that `views` in the fixture's folder holds.
  FitInput Input() const { return Ok(ReadFitFolder(folder_ / "views", 0)).value(); }
  // Renders that folder anew, and reads it.
  FitInput Views(const Mesh& mesh, const ViewsOptions& options) {
    Ok(MakeViews(mesh, options, folder_ / "views", OutputGuard(true), {}, stop_));
    return Input();
  }
  // The mesh as it was rendered.
  Mesh Truth() const { return Ok(io::LoadMesh(folder_ / "views" / "truth.glb"))->mesh; }

  Result<FitOutcome> Run(const FitJob& job, int workers = 2) {
    return RunFit(job, Workers(workers), {}, stop_);
  }
  // Interrupts the fit once `step` steps are done, as Ctrl-C does.
  void StopAt(const FitJob& job, std::uint64_t step, int workers = 2) {
    const auto watch = [&](const Progress& p) { stop_ = p.stage == "fitting" && p.done == step; };
    const Status stopped = RunFit(job, Workers(workers), watch, stop_).status();
    stop_ = false;
    EXPECT_EQ(stopped.code(), StatusCode::kCancelled) << stopped.message();
    ExpectIn(stopped.message(), "everything is saved");
  }
  // Runs the fit whole, and in parts for other numbers of workers: the last part begins at the last
  // stop, and the meshes are the same. Returns what the last part came to.
  FitOutcome ExpectSameInParts(FitJob job, const std::vector<std::uint64_t>& stops) {
    const Path whole = job.out;
    Ok(Run(job, 1).status());
    job.out += "_parts";
    for (const std::uint64_t step : stops) {
      StopAt(job, step);
      job.existing = ExistingRun::kContinue;
    }
    const auto resumed = Ok(Run(job, 7));
    EXPECT_EQ(resumed->first_step, static_cast<std::int64_t>(stops.back()));
    EXPECT_EQ(ReadFile(whole / "mesh.glb").value(), ReadFile(job.out / "mesh.glb").value());
    return *resumed;
  }

  StopFlag stop_ = false;
};

}  // namespace tilegrad::train
