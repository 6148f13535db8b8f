// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/config.h"

namespace tilegrad::train {

ConfigFields FieldsOf(ClassifyConfig* c) {
  return Joined(
      {{{"network.channels", &c->network.channels, 1, 4096,
         "channels of the first level; they double"},
        {"network.most", &c->network.most, 1, 4096, "up to this many"},
        {"network.levels", &c->network.levels, 1, 8, "convolutions, each at half the size"}},
       Without(FieldsOf(&c->optimizer),
               {"optimizer.beta1", "optimizer.beta2", "optimizer.average"}),
       {{"optimizer.weight_decay", &c->optimizer.weight_decay, 0, 1,
         "weight decay per step, relative to the learning rate"},
        {"schedule.batch", &c->batch, 2, 65536, "pictures per step, one per model"},
        {"schedule.mirrored", &c->mirrored, 0, 1, "fraction of the pictures mirrored"},
        {"schedule.shift", &c->shift, 0, 64,
         "largest random shift of a picture along each axis, pixels"}}});
}

}  // namespace tilegrad::train
