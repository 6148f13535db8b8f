// SPDX-License-Identifier: Apache-2.0
// Hollows that no mask shows: the insides of cups, bowls, baths and boxes without a lid.
#pragma once

#include "base/parallel.h"
#include "base/progress.h"
#include "fit/input.h"
#include "scene/level_set.h"

namespace tilegrad::train {

// Takes hollows that open upwards (+y) out of a hull (Carve). In a picture that looks into a
// hollow, the lid that the hull has over it shows colours on which the views disagree. Shapes of a
// few numbers (hollow_shape.h) are proposed below every lid; that with the least difference of
// colours between each view and the others, seen through the hollow, is taken, less the cells
// through which views agree less than on the lid. Two shapes are compared over the pixels whose
// insides other views see in both; among equals it is the one of the thinnest walls and the lowest
// floor. It must leave at most 0.7 of the difference of its lid and 0.85 of that of a flat one,
// 0.004 less than either (colours in [0, 1]), and be a twentieth of the hull; otherwise the hull
// keeps its bits. What is below a lid of one colour, or of colours that change with the view, stays
// full. A pure function of its input for any number of workers. Returns whether there is a hollow,
// or kCancelled.
Result<bool> CarveHollows(const FitInput& input, const Workers& workers, const Watch& watch,
                          ScalarGrid* hull);

}  // namespace tilegrad::train
