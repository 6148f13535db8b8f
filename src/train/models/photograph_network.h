// SPDX-License-Identifier: Apache-2.0
// The network of section 5.4: from a photograph it predicts the deformation of a learned mean
// shape, the texture, keypoints and the camera. As CMR's (Kanazawa et al., ECCV 2018), but encoder
// and decoder are a U-Net; the texture is a map (DIB-R's) or a flow that says where to sample each
// texel in the photograph (CMR's).
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "nn/ops.h"
#include "scene/mesh.h"
#include "train/models/picture_lookup.h"
#include "train/models/sphere_model.h"

namespace tilegrad::train {

struct PhotographNetworkConfig {
  PictureCodeConfig code = {.most = 192, .latent = 200};
  std::string texture = "direct";                       // or "flow"
  bool symmetric_texture = true;                        // the map is symmetric at x = 0
  SphereConfig sphere = {.radius = 1, .smoothing = 2};  // of movements and mean shape
  double output_deviation = 1e-4;  // initial weights of the movement head are N(0, this^2)
  // Camera hypotheses per picture, initially spread evenly around the object, with a logit each:
  // one camera would learn the mean where a picture does not tell front from rear.
  std::int64_t azimuths = 1;
  // Output of the camera head: "quaternion", or "rows", the first two of the rotation matrix.
  std::string rotation = "quaternion";
};

// The initial mean shape: a sphere whose vertices are moved radially onto the convex hull of
// `keypoints` (PhotographSet::mean_keypoints), if there are any; smoothed as movements are. The
// network learns `count` keypoints, each initially from the vertices near its place.
struct PhotographStart {
  std::vector<std::array<double, 3>> keypoints = {};
  std::size_t count = 0;  // keypoints.size(), or the number of a network to be loaded
};

class PhotographNetwork {
 public:
  // `image_size`: pixels, a multiple of 2^levels. The seed determines every weight.
  PhotographNetwork(nn::Context& context, const PhotographNetworkConfig& config,
                    const PhotographStart& start, int image_size, std::uint64_t seed);

  // pictures: [B, 3, size, size] in [0, 1]. Returns the symmetric movement from the mean shape,
  // positions, textures, the flow (with "flow"), keypoints if it has any, and the cameras, in whose
  // world the rest is.
  Prediction Forward(const nn::Var& pictures, nn::Mode mode);
  nn::Var MeanShape() const;        // [1, V, 3]
  nn::Var KeypointWeights() const;  // [K, V], rows sum to 1; invalid without keypoints
  nn::Var Keypoints(const nn::Var& positions) const;  // [B, V, 3] -> [B, K, 3]

  nn::Module& module() { return all_; }
  const SphereModel& sphere() const { return sphere_; }

 private:
  void BuildHeads(Rng& rng);
  void StartShape(const PhotographStart& start);
  void Texture(const PictureCode::Encoded& encoded, nn::Mode mode, Prediction* out);
  void Cameras(const nn::Var& latent, nn::Mode mode, Prediction* out);
  bool turns_by_rows() const { return config_.rotation == "rows"; }
  std::int64_t CameraNumbers() const;  // of the head, for one camera
  std::vector<double> StartingNumbers(int k) const;
  nn::Var CamerasOf(const nn::Var& raw) const;

  nn::Context& context_;
  PhotographNetworkConfig config_;
  int texture_size_;
  SphereModel sphere_;
  nn::AxisMap mirror_;  // of texel columns
  struct Parts : nn::Module {
    std::optional<PictureCode> code;
    nn::Sequential shape, camera;
    nn::Var mean_shape;  // [1, 3 V]
    nn::Var keypoints;   // [K, V], logits
    nn::Var Forward(const nn::Var& x, nn::Mode mode) override { return code->Forward(x, mode); }
    void Visit(const std::string& prefix, nn::ModuleVisitor& visitor) override;
  } all_;
};

// InvalidArgument names a key that is invalid or does not fit pictures of that size.
Status CheckNetwork(const PhotographNetworkConfig& config, int image_size);

// Initial rotation of camera `k` of `count`: upright, turned by k / count of a circle about y; (w,
// x, y, z).
std::array<double, 4> StartingRotation(int k, int count);
// The index of the initial rotation nearest to `quaternion`.
int NearestStart(const std::array<double, 4>& quaternion, int count);

// Distance from `centre`, which lies within the convex hull of `points`, to the hull in a unit
// direction; 0 if the hull is flat there.
double HullReach(const std::vector<std::array<double, 3>>& points,
                 const std::array<double, 3>& centre, const std::array<double, 3>& direction);

}  // namespace tilegrad::train
