// SPDX-License-Identifier: Apache-2.0
#include "train/models/photograph_network.h"

#include <cmath>
#include <glm/geometric.hpp>

#include "base/error.h"
#include "nn/nn.h"

namespace tilegrad::train {
namespace {

using KeypointPlace = std::array<double, 3>;

constexpr double kStartRadius = 0.6;     // without keypoints; the object's longest is about 2
constexpr double kStartScale = 0.9;      // of cameras, where an object fills its crop
constexpr double kLeastReach = 0.12;     // a hull that is flat or thin is filled up to this
constexpr double kKeypointNearness = 8;  // of a keypoint's weights: exp(-(this * distance)^2)
constexpr std::int64_t kWeakCameraNumbers = 7;

glm::dvec3 VectorOf(const KeypointPlace& p) { return {p[0], p[1], p[2]}; }

double Determinant(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  return glm::dot(a, glm::cross(b, c));
}

KeypointPlace Middle(const std::vector<KeypointPlace>& points) {
  KeypointPlace sum = {};
  for (const KeypointPlace& p : points)
    for (std::size_t c = 1; c < 3; ++c) sum[c] += p[c] / static_cast<double>(points.size());
  return sum;  // in the plane of symmetry
}

// Scale, shift and quaternion of what the last layer says. Its bias is an upright camera.
nn::Var CamerasOf(const nn::Var& raw) {
  return nn::Concat({kStartScale * nn::Exp(nn::Tanh(nn::Slice(raw, 1, 0, 1))),
                     nn::Slice(raw, 1, 1, 3), UnitRows(nn::Slice(raw, 1, 3, 7))},
                    1);
}

}  // namespace

// All triangles of the points lie within the hull, and its faces are among them.
double HullReach(const std::vector<KeypointPlace>& points, const KeypointPlace& centre,
                 const KeypointPlace& direction) {
  double reach = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const glm::dvec3 p = VectorOf(points[i]), u = VectorOf(points[j]) - p,
                         v = VectorOf(points[k]) - p, back = -VectorOf(direction);
        // p - centre + s u + r v = t direction, by Cramer's rule
        const double all = Determinant(u, v, back);
        if (std::abs(all) < 1e-12) continue;
        const glm::dvec3 to = -(p - VectorOf(centre));
        const double s = Determinant(to, v, back) / all, r = Determinant(u, to, back) / all,
                     t = Determinant(u, v, to) / all;
        if (s >= -1e-9 && r >= -1e-9 && s + r <= 1 + 1e-9) reach = std::max(reach, t);
      }
    }
  }
  return reach;
}

Status CheckNetwork(const PhotographNetworkConfig& config, int image_size) {
  if (config.texture != "direct" && config.texture != "flow")
    return InvalidArgument("network.texture is \"{}\", but must be \"direct\" or \"flow\"",
                           config.texture);
  if (nn::CanHalve(image_size, config.levels)) return {};
  return InvalidArgument(
      "pictures of {} pixels a side cannot be halved {} times to at least two "
      "pixels: choose another network.levels or photographs.size",
      image_size, config.levels);
}

void PhotographNetwork::Parts::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  code->Visit(prefix, visitor);
  shape.Visit(prefix + "shape.", visitor);
  camera.Visit(prefix + "camera.", visitor);
  visitor.Parameter(prefix + "mean_shape", mean_shape);
  if (keypoints.valid()) visitor.Parameter(prefix + "keypoints", keypoints);
}

PhotographNetwork::PhotographNetwork(nn::Context& context, const PhotographNetworkConfig& config,
                                     const PhotographStart& start, int image_size,
                                     std::uint64_t seed)
    : context_(context),
      config_(config),
      texture_size_(image_size << config.enlarge),
      sphere_(context, config.sphere) {
  Rng rng(seed, /*stream=*/0x70686f74);
  const bool flow = config.texture == "flow";
  const nn::UNetShape unet{.in = 3,
                           .out = flow ? 2 : 3,
                           .base = config.base,
                           .most = config.most,
                           .levels = static_cast<int>(config.levels),
                           .skips = config.skips,
                           .enlarge = static_cast<int>(config.enlarge),
                           .output = flow ? &nn::Tanh : &nn::Sigmoid};
  all_.code.emplace(
      context, unet,
      PictureCodeShape{.image_size = image_size, .latent = config.latent, .layers = 2}, rng);
  BuildHeads(rng);
  StartShape(start);
  if (config.symmetric_texture) mirror_ = MirrorColumns(context, texture_size_);
}

void PhotographNetwork::BuildHeads(Rng& rng) {
  const std::int64_t latent = config_.latent;
  auto& offsets = nn::AddLinear(all_.shape, "fc", context_, latent, sphere_.numbers(), rng);
  nn::FillNormal(offsets.weight.value(), rng, config_.output_deviation);
  nn::FillConstant(offsets.bias.value(), 0);
  auto& camera = nn::AddLinear(all_.camera, "fc", context_, latent, kWeakCameraNumbers, rng);
  // Half a turn about x: the world's y, which is up, to the image's, which is down.
  camera.bias.value() =
      context_.From({kWeakCameraNumbers}, std::span<const double>({0., 0., 0., 0., 1., 0., 0.}));
}

void PhotographNetwork::StartShape(const PhotographStart& start) {
  const std::size_t vertices = sphere_.mesh().positions.size();
  const KeypointPlace centre = start.keypoints.empty() ? KeypointPlace{} : Middle(start.keypoints);
  std::vector<double> shape, logits(start.count * vertices);
  for (std::size_t v = 0; v < vertices; ++v) {
    const glm::vec3& p = sphere_.mesh().positions[v];
    const KeypointPlace direction = {p.x, p.y, p.z};
    const double reach = start.keypoints.empty()
                             ? kStartRadius
                             : std::max(HullReach(start.keypoints, centre, direction), kLeastReach);
    for (std::size_t c = 0; c < 3; ++c) shape.push_back(centre[c] + reach * direction[c]);
    for (std::size_t k = 0; k < start.keypoints.size(); ++k) {
      double squares = 0;
      for (std::size_t c = 0; c < 3; ++c)
        squares += std::pow(start.keypoints[k][c] - shape[3 * v + c], 2);
      logits[k * vertices + v] = -kKeypointNearness * kKeypointNearness * squares;
    }
  }
  const auto v = static_cast<std::int64_t>(vertices), k = static_cast<std::int64_t>(start.count);
  all_.mean_shape =
      nn::Parameter(context_, context_.From({1, 3 * v}, std::span<const double>(shape)));
  if (k > 0)
    all_.keypoints =
        nn::Parameter(context_, context_.From({k, v}, std::span<const double>(logits)));
}

nn::Var PhotographNetwork::MeanShape() const { return sphere_.Movement(all_.mean_shape); }

nn::Var PhotographNetwork::KeypointWeights() const {
  return all_.keypoints.valid() ? nn::Softmax(all_.keypoints, 1) : nn::Var();
}

nn::Var PhotographNetwork::Keypoints(const nn::Var& positions) const {
  if (!all_.keypoints.valid()) return {};
  const std::int64_t batch = positions.shape()[0], vertices = positions.shape()[1],
                     count = all_.keypoints.shape()[0];
  const nn::Var side_by_side =
      nn::Reshape(nn::Permute(positions, {1, 0, 2}), {vertices, 3 * batch});
  const nn::Var product = nn::Matmul(KeypointWeights(), side_by_side);
  return nn::Permute(nn::Reshape(product, {count, batch, 3}), {1, 0, 2});
}

void PhotographNetwork::Texture(const PictureCode::Encoded& encoded, nn::Mode mode,
                                Prediction* out) {
  nn::Var map = all_.code->DecodeMap(encoded, mode);
  if (config_.symmetric_texture) map = nn::MapAxis(map, 3, mirror_);
  if (config_.texture == "flow") {
    out->flow = map;
    map = nn::SamplePictures(encoded.levels.front().value(), map);
  }
  out->textures = nn::Permute(map, {0, 2, 3, 1});
}

Prediction PhotographNetwork::Forward(const nn::Var& pictures, nn::Mode mode) {
  Prediction out;
  const PictureCode::Encoded encoded = all_.code->Encode(pictures, mode);
  if (!encoded.latent.valid()) return out;
  out.movement = sphere_.Movement(all_.shape.Forward(encoded.latent, mode));
  out.positions = MeanShape() + out.movement;
  out.keypoints = Keypoints(out.positions);
  out.cameras = CamerasOf(all_.camera.Forward(encoded.latent, mode));
  Texture(encoded, mode, &out);
  return out;
}

}  // namespace tilegrad::train
