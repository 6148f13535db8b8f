// SPDX-License-Identifier: Apache-2.0
// Samples the input picture at each texel of a predicted surface, through the predicted camera and
// shape. Without gradient: the results are inputs of networks.
#pragma once

#include <array>
#include <vector>

#include "nn/context.h"
#include "nn/networks.h"
#include "nn/ops.h"
#include "scene/mesh.h"
#include "scene/shapes.h"
#include "tilegrad/camera.h"

namespace tilegrad::train {

// A camera that looks roughly at the origin, as outputs of a network: the first two rows of its
// rotation; the principal point's shift from the middle; the image size of a unit length at the
// origin; 1 / distance. The last four are shifted and scaled to be about 1 or less.
inline constexpr std::int64_t kPoseNumbers = 10;
using Pose = std::array<double, kPoseNumbers>;
// `size`: pixels a side of the image.
Pose PoseOf(const Camera& camera, int size);
// The camera of a predicted pose, with its rotation made orthonormal.
Camera CameraOf(const Pose& pose, int size);

class PictureLookup {
 public:
  // For maps [side][side] of the sphere, by longitude and latitude.
  PictureLookup(const Mesh& sphere, int side);

  struct Job {
    const nn::Tensor& images;     // [M,4,size,size], RGB over black and cover
    const nn::Tensor& positions;  // [M,V,3]
    const nn::Tensor& pose;       // [M,10]: Pose, whose rows need not be orthonormal
    nn::Tensor light = {};        // [M,3] unit, in the axes of the camera; empty: none
  };
  // For each texel, and then for its mirror image at x = 0: RGB (of the picture, divided by the
  // cover), the cover, n.v towards the camera (< 0: turned away), ln of 1 over the Lambert light
  // there, at most ln 4. Does not test for occlusion.
  static constexpr std::int64_t kChannels = 6;
  // [M, 2 kChannels, side, side], or only the first three of each: [M, 6, side, side].
  nn::Tensor Look(nn::Context& context, const Job& job) const;
  nn::Tensor Colors(nn::Context& context, const Job& job) const;

  // [M, kCues]: how brightness varies with the normals that the camera sees, which indicates the
  // light's direction. The mean normal; the mean brightness; their covariance, divided by that
  // mean; the share that is not black, and its mean normal; last the unit direction d for which a
  // multiple of n.d fits the brightness of what is not black best, as if all had one paint.
  static constexpr std::int64_t kCues = 14;
  nn::Tensor Cues(nn::Context& context, const Job& job) const;

 private:
  template <class T>
  class Picture;  // one of a Job
  template <class T>
  void LookAt(const Job& job, std::size_t m, std::size_t channels, T* out) const;
  nn::Tensor Run(nn::Context& context, const Job& job, std::int64_t channels) const;

  std::size_t side_;
  std::vector<Face> faces_;
  std::vector<SurfacePoint> texels_;  // [side][side]
};

// The common part of the networks of sections 5.2 to 5.4: a U-Net from a picture to a map of the
// sphere, whose bottleneck passes through a code that also feeds the other heads.

// What runs configure of it. The defaults are those of section 5.2.
struct PictureCodeConfig {
  std::int64_t base = 24;     // U-Net: channels of the first level; they double to at most
  std::int64_t most = 256;    // this many
  std::int64_t levels = 4;    // halvings
  std::int64_t enlarge = 1;   // the texture is 2^this times as large as the picture
  bool skips = true;          // the U-Net's skip connections
  std::int64_t latent = 384;  // width of the fully connected code that feeds all heads
};

// `ends`, which has the channels of picture and map and the map's output function, with the rest
// as configured.
nn::UNetShape UNetOf(const PictureCodeConfig& config, nn::UNetShape ends);

struct PictureCodeShape {
  std::int64_t image_size = 64;  // pixels a side, a multiple of 2^levels of the U-Net
  std::int64_t latent = 384;     // width of the code
  int layers = 1;                // fully connected, from the U-Net's bottom to the code
};

class PictureCode : public nn::Module {
 public:
  PictureCode(nn::Context& context, const nn::UNetShape& unet, const PictureCodeShape& shape,
              Rng& rng);

  struct Encoded {
    nn::StepVector<nn::Var> levels;  // UNet::Encode
    nn::Var latent;                  // [B, latent]
  };
  Encoded Encode(const nn::Var& pictures, nn::Mode mode);    // [B, in, size, size]
  nn::Var DecodeMap(const Encoded& encoded, nn::Mode mode);  // [B, out, h, w]

  nn::Var Forward(const nn::Var& pictures, nn::Mode mode) override {
    return DecodeMap(Encode(pictures, mode), mode);
  }
  void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;

 private:
  nn::UNet unet_;
  nn::Sequential latent_, map_;
  nn::Shape bottom_;  // of the U-Net, for one picture
};

// Rows of v [B, n], each divided by sqrt(|v|^2 + 1e-8), so that rows of zeros stay zero.
nn::Var UnitRows(const nn::Var& v);

// Converts maps of a sphere to N3MR's texture cubes of 2 x 2 x 2 texels a face, and back, so that
// one network serves both renderers.

class FaceCubes {
 public:
  static constexpr std::int64_t kTexels = 8;  // of a face; texel (i, j, k) is number 4 i + 2 j + k

  FaceCubes() = default;
  // `sphere` with SphereUvs; maps are side x side.
  FaceCubes(nn::Context& context, const Mesh& sphere, int side);

  // textures [B,side,side,3] -> [B,F,8,3]: as in N3MR's loader, bilinear samples at barycentric
  // coordinates (i, j, k) / (i + j + k), and at the middle for (0, 0, 0).
  nn::Var Cubes(const nn::Var& textures) const;
  // [B,F,8,3] -> [B,side,side,3]: what N3MR would show at each texel's place.
  nn::Var Maps(const nn::Var& cubes) const;

 private:
  std::int64_t side_ = 0, faces_ = 0;
  nn::AxisMap to_cubes_, to_maps_;  // of [side side] and of [8 F]
};

// positions [N,V,3], directions [N,3] in the world -> [N,F,1,1]: ambient + max(0, n.d) with each
// face's outward normal n, as N3MR lights faces.
nn::Var FaceLight(const nn::Var& positions, const std::vector<Face>& faces,
                  const nn::Var& directions, double ambient);

}  // namespace tilegrad::train
