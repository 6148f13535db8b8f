// SPDX-License-Identifier: Apache-2.0
// What is drawn by lot of the views of a streamed object: cameras, and the light that is the same
// in all of them.
#pragma once

#include <array>

#include "base/rng.h"
#include "tilegrad/scene.h"
#include "train/data/dataset.h"
#include "train/data/stream/stream_config.h"

namespace tilegrad::train {

// View 0 is what the network sees; the others have a range of elevations of their own. Azimuth from
// all the circle; the size of objects in the image is that of `rule`, within jitter. With
// fixed_camera only the azimuth is drawn, and all else is of `rule`.
Camera DrawCamera(const StreamConfig& config, const CameraRule& rule, std::size_t view, Rng& rng);

// The key and the fill light of datasets, each turned about the vertical and up or down.
std::array<Light, 2> DrawLights(const StreamConfig& config, Rng& rng);

}  // namespace tilegrad::train
