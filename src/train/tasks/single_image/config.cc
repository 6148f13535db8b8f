// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/single_image/config.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(NetworkConfig* c) {
  return Joined(
      {{{"network.channels", &c->channels, 1, 4096,
         "channels of the first convolution; then 2x and 4x"},
        {"network.blocks", &c->blocks, 0, 16,
         "residual blocks after the second and after the third convolution"},
        {"network.code", &c->code, 1, 65536, "width of the encoder's fully connected layers"},
        {"network.hidden1", &c->hidden1, 1, 65536, "width of each decoder's first layer"},
        {"network.hidden2", &c->hidden2, 1, 65536, "width of each decoder's second layer"}},
       FieldsOf(&c->sphere),
       {{"network.fc_norm", &c->fc_norm, 0, 1, "batch norm after hidden fully connected layers"},
        {"network.fc_deviation", &c->fc_deviation, 0, 10,
         "fully connected weights start as N(0, this^2); 0: uniform by fan-in"},
        {"network.output_deviation", &c->output_deviation, 0, 10,
         "the decoders' last weights start as N(0, this^2)"},
        {"network.color_bias", &c->color_bias, -1, 2,
         "initial vertex colours, without picture_colors"},
        {"network.picture_colors", &c->picture_colors, 0, 1,
         "look up vertex colours in the input image"},
        {"network.n3mr_vertices", &c->sphere.n3mr_vertices, 0, 1,
         "N3MR's sigmoids and centroid instead of offsets"}}});
}

ConfigFields ScheduleFields(SingleImageConfig* c) {
  return {
      {"schedule.batch", &c->batch, 2, 65536, "objects per step; batch norm needs two"},
      {"schedule.views", &c->views, 1, 64, "views rendered per object: its own and random others"},
      {"schedule.mirrored", &c->mirrored, 0, 1, "fraction of the objects mirrored left to right"},
  };
}

}  // namespace

Status CheckConfig(const SingleImageConfig& config) {
  const SphereConfig& n = config.network.sphere;
  if (n.n3mr_vertices && (n.smoothing > 0 || n.symmetric)) {
    return InvalidArgument(
        "network.n3mr_vertices has no offsets to smooth or mirror: network.smoothing must be 0 and "
        "network.symmetric false");
  }
  return RivalOptions(config.render.rule, config.rivals).status();
}

ConfigFields FieldsOf(SingleImageConfig* c) {
  return Joined({FieldsOf(&c->network), FieldsOf(&c->loss), FieldsOf(&c->render),
                 FieldsOf(&c->optimizer), ScheduleFields(c), FieldsOf(&c->rivals),
                 FieldsOf(&c->stream)});
}

}  // namespace tilegrad::train
