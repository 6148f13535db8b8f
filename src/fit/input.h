// SPDX-License-Identifier: Apache-2.0
// What a fit is given: images with masks, and their cameras.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "base/progress.h"
#include "fit/frames.h"
#include "fit/image_loss.h"
#include "fit/input.h"
#include "scene/camera.h"
#include "scene/mesh.h"

namespace tilegrad::train {

struct FitInput {
  std::vector<std::string> names;  // of the views, for messages
  std::vector<Camera> cameras;
  TargetImages images;                  // straight colours (not multiplied by alpha)
  std::vector<int> training, held_out;  // indices of views; every view is in one of them
  std::vector<int> turned;  // views rotated 90 degrees clockwise with their cameras; ascending
  bool masked = false;      // some image says where the object is
  // No image says where the object is, but cameras are known: masks are to be found (masks/).
  bool seeks_masks = false;
  bool masks_found = false;  // masks were found in the images, which had none
  // Of those that views have in common: how well they agree with what all views have in common,
  // IoU, mean.
  std::optional<double> mask_agreement;
  bool posed = true;   // cameras are known; else only their lenses are
  bool found = false;  // cameras were found by looking at the images
  // Cameras as they were given, where those above were found by looking at the images all the same;
  // else empty. In a world of their own.
  std::vector<Camera> given_cameras;
  std::vector<std::string> warnings;  // for people
  std::vector<std::string> notes;     // for people, too: the confidence of each stage
  // The cameras' world is COLMAP's own, which has no up.
  bool own_world = false;
  UpAxis up = UpAxis::kY;  // of the world that the input is from; in that of `cameras` it is y

  // Of a dataset, what is known of the truth: occupancy at kOccupancyResolution. Else empty.
  std::vector<std::uint8_t> occupancy;
};

// Where masks come from.
enum class Background {
  kAuto,   // as kMask where an image has an alpha or a mask, else as kViews or kPlain
  kMask,   // alpha and masks of the input
  kPlain,  // plain backgrounds are recognised (background.h); alpha and masks are ignored
  kNone,   // there is none: every pixel shows the object
  kViews,  // what the views have in common, where cameras are known (masks/find_masks.h)
};
inline constexpr std::size_t kLeastMaskViews = 6;  // of kViews: fewer have too little in common

// auto, mask, plain, none or views.
std::optional<Background> BackgroundNamed(std::string_view name);

// Beyond it, images say little more to a fit, and take memory and time.
inline constexpr int kUsualSide = 1600;  // pixels along the longer side

struct InputOptions {
  int hold_out = 0;  // every n-th view; 0: none
  Background background = Background::kAuto;
  double fov = kUsualFov;  // of images without cameras, degrees along their longer side
  // The axis of the cameras' world that points up; none: as the cameras make plain, or else y.
  std::optional<UpAxis> up = std::nullopt;
  Watch watch = {};  // of reading and masks
  Path masks = {};   // a folder of masks instead of the images' own (masks/start_masks.h)
  // Images with more pixels along their longer side are reduced by a whole factor; 0: none are.
  int image_side = kUsualSide;
};

// A folder with transforms.json, or transforms_train.json, or a COLMAP project. Views of
// transforms_test.json beside it, if it is there, are held out; otherwise every `hold_out`-th (0:
// none). Or a folder of pictures alone, which come without cameras (frames.h). An image's mask
// is its alpha, or the mask_path of its frame (grey or alpha); either all have one or none. All
// images must have one size, portrait or landscape (quarter_turn.h). Lenses that bend rays are
// straightened (undistort.h), and large images reduced. Errors name the file.
Result<FitInput> ReadFitFolder(const Path& folder, const InputOptions& options);
inline Result<FitInput> ReadFitFolder(const Path& folder, int hold_out) {
  return ReadFitFolder(folder, InputOptions{.hold_out = hold_out});
}

// What is left to do once there are names, cameras and images: masks as `background` says, of
// images with alpha or opaque ones; every `hold_out`-th of the views that are not held out is; the
// world turned so that y is up (TurnInputUpright). Views whose mask is empty go, with a warning. An
// error if no view is left to fit, or names one whose camera no fit can compute with (CheckCamera).
Status FinishInput(const InputOptions& options, FitInput* input);

// Whether some pixel is not opaque.
bool HasAlpha(const FitInput& input);
// Sets `seeks_masks`: whether masks are those that views have in common, which StartMasks then
// finds. An error if that is asked for without cameras or of too few views.
Status SeekMasks(Background background, FitInput* input);
// Masks from alpha or plain backgrounds; sets `masked`. Where masks are to be sought, plain
// backgrounds take their place only if no view is in doubt. An error only if stopped.
Status ApplyBackground(Background background, FitInput* input, const Watch& watch = {});
// Masks of all images by their plain backgrounds, with a warning for each that is in doubt.
Status TakePlainBackgrounds(FitInput* input, const Watch& watch = {});
// Takes away views that show no object, with a warning for each. An error if all are such.
Status DropEmptyViews(FitInput* input);

// One model of a dataset (train/data/dataset.h), named "CLASS/ID".
Result<FitInput> ReadFitDataset(const Path& folder, const std::string& model, int hold_out);

// Images as datasets and PrepareCutout have them, bytes of [views][4][size][size] with RGB over
// black.
TargetImages TargetsOfPlanar(std::span<const std::uint8_t> bytes, int size);

// Means over squares of `factor` pixels; colours weighted by alpha. What is left over on the right
// and below is cut off.
TargetImages Reduce(const TargetImages& images, int factor);

// The axis that all cameras stand upright about; none where that is not plain, or is y.
std::optional<UpAxis> GuessUp(std::span<const Camera> cameras);

// Turns the world y up, as in glTF, from `up` or, if that is not given, from GuessUp, with a
// warning. In COLMAP's own world, up is the mean up of the cameras as they were held (UpOf).
void TurnInputUpright(std::optional<UpAxis> up, FitInput* input);

}  // namespace tilegrad::train
