// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/photographs/config.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

ConfigFields FieldsOf(PhotographNetworkConfig* c) {
  return Joined(
      {FieldsOf(&c->code),
       {{"network.texture", &c->texture, 0, 0,
         "\"direct\": a texture map; \"flow\": the position of each texel in the photograph (CMR)"},
        {"network.symmetric_texture", &c->symmetric_texture, 0, 1,
         "the texture is symmetric at x = 0, as every shape is"}},
       Without(FieldsOf(&c->sphere), {"network.template_radius", "network.symmetric"}),
       {OutputDeviation(&c->output_deviation),
        {"network.azimuths", &c->azimuths, 1, 64,
         "camera hypotheses per photograph, evenly spread in azimuth; the likeliest is used"},
        {"network.rotation", &c->rotation, 0, 0,
         "what the camera head gives of a rotation: \"quaternion\", or \"rows\": two of its "
         "matrix"}}});
}

ConfigFields FieldsOf(PhotographLosses* c) {
  return {
      {"loss.keypoint", &c->keypoint, 0, kNoLimit, "weight of the keypoints' mean square error"},
      {"loss.mask", &c->mask, 0, kNoLimit, "weight of the silhouettes' mean square error"},
      {"loss.iou", &c->iou, 0, kNoLimit, "weight of equation 12"},
      {"loss.camera", &c->camera, 0, kNoLimit, "weight of the predicted camera's error"},
      {"loss.azimuth", &c->azimuth, 0, kNoLimit,
       "weight of the cross-entropy of the camera hypotheses; needs network.azimuths above 1"},
      {"loss.deformation", &c->deformation, 0, kNoLimit, "weight of the mean displacement"},
      {"loss.laplacian", &c->laplacian, 0, kNoLimit, "weight of the cotangent Laplacian"},
      {"loss.entropy", &c->entropy, 0, kNoLimit, "weight of the entropy of keypoints' weights"},
      {"loss.color", &c->color, 0, kNoLimit, "weight of equation 13, on pixels of the object"},
      {"loss.flow_distance", &c->flow_distance, 0, kNoLimit,
       "weight of the distance of the flow from the object; needs network.texture = \"flow\""},
      {"loss.color_moves", &c->color_moves, 0, 1, "the colour loss also moves shape and camera"},
  };
}

ConfigFields OwnFields(PhotographsConfig* c) {
  return {
      {"photographs.size", &c->size, 8, 1024, "width and height of the network's input, pixels"},
      {"photographs.padding", &c->crop.padding, 0, 1,
       "padding of an object's box on each side, as a fraction of it"},
      {"photographs.jitter", &c->crop.jitter, 0, CropRule::kMostJitter,
       "random shift of the box's edges in training, as a fraction of it"},
      {"photographs.cutouts", &c->cutouts, 0, 1,
       "fraction of inputs with a black background, like cut-outs"},
      {"photographs.camera", &c->camera, 0, 0,
       "cameras that render predictions in training: \"given\" or \"predicted\""},
      {"start.run", &c->start, 0, 0,
       "folder of a run whose weights initialise this one; \"\": none"},
      {"schedule.batch", &c->batch, 1, 65536, "photographs per step"},
  };
}

}  // namespace

ConfigFields FieldsOf(PhotographsConfig* c) {
  return Joined({FieldsOf(&c->network), FieldsOf(&c->loss), FieldsOf(&c->adversary),
                 Without(FieldsOf(&c->render), {"render.rule"}), FieldsOf(&c->optimizer),
                 OwnFields(c)});
}

Status CheckConfig(const PhotographsConfig& config) {
  TILEGRAD_TRY(CheckNetwork(config.network, static_cast<int>(config.size)));
  if (config.camera == "predicted" && config.network.azimuths > 1)
    return InvalidArgument(
        "network.azimuths is {}, which needs given cameras to learn from: leave photographs.camera "
        "at \"given\"",
        config.network.azimuths);
  if (config.camera == "given" || config.camera == "predicted") return {};
  return InvalidArgument("photographs.camera is \"{}\", but must be \"given\" or \"predicted\"",
                         config.camera);
}

}  // namespace tilegrad::train
