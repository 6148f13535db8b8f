// SPDX-License-Identifier: Apache-2.0
// Texels that no view shows: they take the colours of those around them, on the surface where it
// has any, and charts get a border, so that filters find no foreign colour there.
#pragma once

#include <span>
#include <vector>

#include "fit/scene.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// Whether a pixel of these views depends on the texel, [H W]. Images are width x height pixels.
Result<std::vector<bool>> SeenTexels(const FitScene& scene, std::span<const int> views,
                                     ImageSize size, const Workers& workers);

// The chart of each texel whose centre is on one, [H W], else -1: faces with common texture
// coordinates are of one chart.
std::vector<std::int32_t> ChartsOfTexels(const FitScene& scene);

// Rings of texels that are not seen take the mean of their neighbours that have a colour: of the
// same chart, from the seen ones on; then everything else. Without a seen texel nothing changes.
void FillUnseenTexels(const std::vector<bool>& seen, FitScene* scene);

}  // namespace tilegrad::train
