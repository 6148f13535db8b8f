// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/stream_config.h"

namespace tilegrad::train {

ConfigField CacheField(std::string* cache) {
  return {
      "stream.cache",
      cache,
      0,
      0,
      "memory for meshes and textures (512M, 4G); the others are read again when they are drawn",
      Affects::kReporting};
}

ConfigFields FieldsOf(StreamConfig* c) {
  return {
      {"stream.share", &c->share, 0, 1,
       "share of the objects of a batch that are deformed and rendered while training"},
      {"stream.max_faces", &c->max_faces, 4, 100000, "of a mesh; larger ones are clustered"},
      CacheField(&c->cache),
      {"stream.samples", &c->samples, 1, 8, "along each side of a pixel"},
      {"stream.stretch", &c->stretch, 0, 2,
       "pieces of an object grow or shrink by up to exp(this) along each axis"},
      {"stream.taper", &c->taper, 0, 2, "the top is wider than the foot by up to exp(this)"},
      {"stream.fixed_camera", &c->fixed_camera, 0, 1,
       "use the dataset's cameras with random azimuths; the next eight keys are ignored"},
      {"stream.elevation_low", &c->elevation_low, -90, 90,
       "lowest elevation of the input view, degrees; azimuths cover the full circle"},
      {"stream.elevation_high", &c->elevation_high, -90, 90, "degrees"},
      {"stream.around_low", &c->around_low, -90, 90,
       "lowest elevation of the other views, degrees; below 0 they show undersides"},
      {"stream.around_high", &c->around_high, -90, 90, "degrees"},
      {"stream.fov_low", &c->fov_low, 1, 150,
       "smallest field of view, degrees; the distance follows from it"},
      {"stream.fov_high", &c->fov_high, 1, 150, "degrees"},
      {"stream.roll", &c->roll, 0, 180, "largest roll to either side, degrees"},
      {"stream.jitter", &c->jitter, 0, 0.5,
       "largest shift and change of size, as a fraction of the image"},
      {"stream.recolor", &c->recolor, 0, 1, "fraction of these objects with changed hues"},
      {"stream.brightness", &c->brightness, 0, 2,
       "brightness changes by a factor of up to exp(this) either way"},
      {"stream.light", &c->light, 0, 1,
       "0: the dataset's light; 1: light from any direction above"},
  };
}

}  // namespace tilegrad::train
