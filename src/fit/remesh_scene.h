// SPDX-License-Identifier: Apache-2.0
// A scene that is being fitted, with other vertices and faces for the same surface.
#pragma once

#include <vector>

#include "base/parallel.h"
#include "fit/parameter_block.h"
#include "fit/scene.h"
#include "scene/remesh.h"

namespace tilegrad::train {

struct RemeshedScene {
  FitScene scene;
  std::vector<ParameterBlock> blocks;  // their moments belong to the new vertices and texels
  RemeshCount count;
};

// Where the optimiser's second moments say that positions still move most, edges become short;
// where the surface is flat, long (scene/remesh.h). A texture gets new charts (scene/unwrap.h), and
// what it held. Errors: the mesh is not a closed manifold; uv is among the parameters, which are
// not carried over; the texture has no room for the charts.
Result<RemeshedScene> RemeshScene(const FitScene& scene, const std::vector<ParameterBlock>& blocks,
                                  const RemeshLimits& limits, const Workers& workers);

}  // namespace tilegrad::train
