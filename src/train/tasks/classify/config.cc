// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/config.h"

namespace tilegrad::train {

ConfigFields FieldsOf(ClassifyConfig* c) {
  return Joined(
      {{{"network.channels", &c->network.channels, 1, 4096,
         "of the first level; then twice as many"},
        {"network.most", &c->network.most, 1, 4096, "channels of a level at most"},
        {"network.levels", &c->network.levels, 1, 8, "convolutions, each at half the size"}},
       Without(FieldsOf(&c->optimizer),
               {"optimizer.beta1", "optimizer.beta2", "optimizer.average"}),
       {{"optimizer.weight_decay", &c->optimizer.weight_decay, 0, 1,
         "share of a weight that each step takes away, times the rate"},
        {"schedule.batch", &c->batch, 2, 65536, "pictures a step, one of each model"},
        {"schedule.mirrored", &c->mirrored, 0, 1, "share of the pictures shown mirrored"},
        {"schedule.shift", &c->shift, 0, 64,
         "pixels that a picture is moved by at most, each way"}}});
}

}  // namespace tilegrad::train
