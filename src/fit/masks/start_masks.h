// SPDX-License-Identifier: Apache-2.0
// The masks that a fit starts from, where no image has one.
#pragma once

#include "fit/run.h"

namespace tilegrad::train {

// If the input seeks masks: finds them and warns of views whose mask is in doubt; where all are,
// plain backgrounds are tried instead. Writes masks that were found, by either way, to <out>/masks.
// `resume`: reads what an earlier call wrote there. Views whose mask is empty go. Errors: those of
// FindMasks, ReadMasks and files.
Status StartMasks(bool resume, FitJob* job, const Workers& workers, const Watch& watch);

// Warns where masks look inverted, or else where objects are cut off: by what covers the border of
// their images.
void DoubtBorders(FitInput* input);

// <folder>/NAME.png for each view, grey; NAME has its own ending, and the view's number before it
// where an earlier view has the same name.
Status WriteMasks(const Path& folder, const FitInput& input);
// The same names, as images or with the ending .png instead of theirs; of the images as a fit sees
// them, upright and without what lenses bend, or larger by a whole factor. Sets alpha. Errors name
// the file.
Status ReadMasks(const Path& folder, FitInput* input);

}  // namespace tilegrad::train
