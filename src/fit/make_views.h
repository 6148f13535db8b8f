// SPDX-License-Identifier: Apache-2.0
// Images of a mesh from all around, as a folder that a fit reads (frames.h): to try things
// with, where the truth is known.
#pragma once

#include "base/output_guard.h"
#include "base/progress.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct ViewsOptions {
  int views = 24, held_out = 8;       // images in transforms_train.json, in transforms_test.json
  int size = 256;                     // pixels a side, 8 to 4096
  double distance = 1.45;             // of the cameras from the middle of the mesh
  double fov_y = 49.13434207744484;   // degrees
  double lowest = -30, highest = 70;  // degrees of elevation, in (-90, 90)
};

// Removes glass, scales the mesh's largest half-extent to 0.45 and its middle to the origin, lights
// it as datasets do (render/picture/mesh_scene.h), and writes
//   <folder>/images/000.png, ...       RGBA, straight alpha
//   <folder>/transforms_train.json, transforms_test.json
//   <folder>/truth.glb                 the mesh as it was rendered
// A folder with files in it is refused, unless `guard` forces it: then what an earlier call left
// goes, cameras first, so that those of a call that was stopped belong to nothing else. Cameras lie
// on a spiral that spreads evenly over the sphere between the two elevations. Errors: options out
// of range; such a folder; a transforms.json, which a fit would read instead.
Status MakeViews(Mesh mesh, const ViewsOptions& options, const Path& folder,
                 const OutputGuard& guard, const ProgressSink& progress, const StopFlag& stop);

}  // namespace tilegrad::train
