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
       "pieces of an object grow by up to exp(this) along each axis, or shrink"},
      {"stream.taper", &c->taper, 0, 2, "its top is wider by up to exp(this) than its foot"},
      {"stream.fixed_camera", &c->fixed_camera, 0, 1,
       "cameras are the dataset's but for their azimuth: the next eight keys mean nothing"},
      {"stream.elevation_low", &c->elevation_low, -90, 90,
       "degrees, of the view that the network sees; azimuths are of all the circle"},
      {"stream.elevation_high", &c->elevation_high, -90, 90, "degrees"},
      {"stream.around_low", &c->around_low, -90, 90,
       "degrees, of the other views; from below they show undersides"},
      {"stream.around_high", &c->around_high, -90, 90, "degrees"},
      {"stream.fov_low", &c->fov_low, 1, 150, "degrees; the distance follows"},
      {"stream.fov_high", &c->fov_high, 1, 150, "degrees"},
      {"stream.roll", &c->roll, 0, 180, "degrees, to either side"},
      {"stream.jitter", &c->jitter, 0, 0.5, "of the image's side: shift, and change of size"},
      {"stream.recolor", &c->recolor, 0, 1, "share of these objects in other hues"},
      {"stream.brightness", &c->brightness, 0, 2,
       "they are brighter by up to exp(this), or darker"},
      {"stream.light", &c->light, 0, 1, "0: the light of datasets; 1: from anywhere above"},
  };
}

}  // namespace tilegrad::train
