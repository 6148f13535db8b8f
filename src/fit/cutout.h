// SPDX-License-Identifier: Apache-2.0
// Cut-out textures for wire and thin leaves: a smooth surface with holes in its texture.
//
// Where masks have many narrow gaps, the visual hull loses everything thinner than a pixel, and the
// rest is ragged. So hull and fit use masks with the gaps closed; then the texture's alpha is
// fitted to the original masks through all layers of the surface. GLB stores it as alphaMode MASK.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "fit/image_loss.h"
#include "fit/run.h"
#include "fit/scene.h"
#include "render/picture/picture.h"

namespace tilegrad::train {

// The job with closed masks as TargetImages::silhouette if it gets a cut-out texture: with kOn, or
// with kAuto if it starts from a hull and the gaps exceed kCutoutGaps; else nothing.
inline constexpr double kCutoutGaps = 0.1;  // ClosedMasks::gaps
std::optional<FitJob> CutoutJob(const FitJob& job, const Workers& workers);

// InvalidArgument if kOn cannot be met: a cut-out needs masks, a texture and unlit colours.
Status CheckCutout(const FitJob& job);

// Sets scene->cutout from the training views.
Status FitCutout(const FitJob& job, const Workers& workers, const Watch& watch, FitScene* scene);

// Masks without their narrow gaps: the outline of the smooth surface.
struct ClosedMasks {
  AlignedVector<float> alpha;  // [N,H,W], nowhere less than the images'
  double gaps = 0;             // closed area over the masks' area, of all views
};

// Morphological closing by a disc with a radius of kClosedShare of the object's width (the root of
// its mean area): closes gaps and bays up to twice as wide.
ClosedMasks CloseMasks(const TargetImages& images, const Workers& workers);

inline constexpr double kClosedShare = 0.03;

// The bilinear footprint of one layer of the surface in the texture.
struct TexelFootprint {
  std::array<std::uint32_t, 4> texels;  // indices in the texture
  std::array<float, 4> weights;         // sum to 1

  float Of(const std::vector<float>& values) const {  // values: one per texel
    float sum = 0;
    for (std::size_t k = 0; k < 4; ++k) sum += weights[k] * values[texels[k]];
    return sum;
  }
};

// The pixels of one view that show the surface, row by row, with all layers behind each.
struct SeenThrough {
  std::vector<std::uint32_t> pixels;  // their indices
  // Pixel i has `layers` [first[i], first[i + 1]), nearest first.
  std::vector<std::uint32_t> first;
  std::vector<TexelFootprint> layers;
};

inline constexpr int kMostLayersSeen = 8;  // per pixel; deeper layers are ignored

// The layers of every `stride`-th pixel of each of `views`. The scene must have a texture.
Result<std::vector<SeenThrough>> SeeThrough(const FitScene& scene, std::span<const int> views,
                                            ImageSize size, std::uint32_t stride,
                                            const Workers& workers);

struct TexelAlpha {
  std::vector<float> alpha;  // per texel, [0, 1], nearly all at an end
  std::vector<bool> seen;    // per texel, by any pixel
};

// Fits the alpha of texels to `masks` (H W each, one for each view of `seen`) by gradient descent
// on the cross entropy. A noisy or: a pixel is covered unless all of its layers are transparent,
// and a covered one is most likely covered by its nearest layer. The same bits for any number of
// workers. Errors: kCancelled.
Result<TexelAlpha> FitTexelAlpha(std::span<const SeenThrough> seen,
                                 std::span<const std::span<const float>> masks, std::size_t texels,
                                 const Workers& workers, const Watch& watch);

// Draws scenes with a cut-out texture, which the renderer of fits cannot.
class CutoutView {
 public:
  // The scene must be unlit. Keeps a reference to the workers.
  CutoutView(const FitScene& scene, const Workers& workers);
  // Takes `samples` x `samples` samples per pixel.
  Result<Picture> Draw(const Camera& camera, ImageSize size, int samples);

 private:
  const Mesh mesh_;
  const MeshScene scene_;
  PictureRenderer renderer_;
};

}  // namespace tilegrad::train
