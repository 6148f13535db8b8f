// SPDX-License-Identifier: Apache-2.0
// The keys of table [stream]: what the pictures that training renders itself may look like.
#pragma once

#include <cstdint>
#include <string>

#include "train/run/config_fields.h"

namespace tilegrad::train {

struct StreamConfig {
  double share = 0;  // of the objects of a batch; the others are the dataset's pictures
  std::int64_t max_faces = 2000;  // of a mesh; larger ones are clustered
  std::int64_t samples = 2;       // along each side of a pixel
  std::string cache = "4G";       // of memory for meshes and textures

  // The shape. Each axis is cut into pieces, and each piece grows or shrinks by a factor of its own
  // within exp(+-stretch); across x = 0 the pieces are mirror images. Upper and lower end then
  // differ in width by a factor within exp(+-taper).
  double stretch = 0.4;
  double taper = 0.15;

  // The camera: any azimuth, and all else as the dataset's rule has it ...
  bool fixed_camera = false;
  // ... or else any value of these ranges. Views from below, which only the losses see, show
  // undersides: silhouettes from above leave room for a cone beneath an object.
  double elevation_low = 5, elevation_high = 45;  // degrees; of the view that the network sees
  double around_low = -45, around_high = 60;      // degrees; of the others
  double fov_low = 30,
         fov_high = 55;  // degrees; the distance follows, so that objects keep their size
  double roll = 4;       // degrees, to either side
  double jitter = 0.04;  // of the image's side: shift, and change of size

  // Colours and light.
  double recolor = 0.5;     // share of the objects whose hues are turned and tinted
  double brightness = 0.2;  // factor within exp(+-brightness)
  double light = 0.25;      // how far lights leave those of datasets: 1 is anywhere above
};

// stream.cache
ConfigField CacheField(std::string* cache);
ConfigFields FieldsOf(StreamConfig* config);

}  // namespace tilegrad::train
