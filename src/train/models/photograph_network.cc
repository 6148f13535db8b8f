// SPDX-License-Identifier: Apache-2.0
#include "train/models/photograph_network.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "nn/nn.h"
#include "scene/weak_perspective_ref.h"
#include "train/models/camera_ops.h"

namespace tilegrad::train {
namespace {

using KeypointPlace = std::array<double, 3>;

constexpr double kStartRadius = 0.6;     // without keypoints; the object's longest is about 2
constexpr double kStartScale = 0.9;      // of cameras, where an object fills its crop
constexpr double kLeastReach = 0.12;     // a hull that is flat or thin is filled up to this
constexpr double kKeypointNearness = 8;  // of a keypoint's weights: exp(-(this * distance)^2)

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

// For each row of logits [B, N] the index of its largest number among the rows of [B N, ..].
std::vector<std::int32_t> Likeliest(const nn::Tensor& logits) {
  const std::int64_t count = logits.shape()[1];
  std::vector<std::int32_t> out;
  nn::WithFloatType(logits.dtype(), [&]<class T>(T) {
    const std::span<const T> all = logits.span<T>();
    for (std::int64_t b = 0; b < logits.shape()[0]; ++b) {
      const auto row =
          all.subspan(static_cast<std::size_t>(b * count), static_cast<std::size_t>(count));
      const auto best = std::ranges::max_element(row) - row.begin();
      out.push_back(static_cast<std::int32_t>(b * count + best));
    }
  });
  return out;
}

}  // namespace

// Half a turn about x, as the world's y, which is up, goes to the image's, which is down; before it
// the turn about y.
std::array<double, 4> StartingRotation(int k, int count) {
  const double half = std::numbers::pi * k / count;
  return {0, std::cos(half), 0, std::sin(half)};
}

int NearestStart(const std::array<double, 4>& quaternion, int count) {
  int best = 0;
  double most = -1;
  for (int k = 0; k < count; ++k) {
    const std::array<double, 4> start = StartingRotation(k, count);
    const double agree =
        std::abs(std::inner_product(start.begin(), start.end(), quaternion.begin(), 0.0));
    if (agree <= most) continue;
    most = agree;
    best = k;
  }
  return best;
}

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
  if (config.rotation != "quaternion" && config.rotation != "rows")
    return InvalidArgument("network.rotation is \"{}\", but must be \"quaternion\" or \"rows\"",
                           config.rotation);
  if (config.texture != "direct" && config.texture != "flow")
    return InvalidArgument("network.texture is \"{}\", but must be \"direct\" or \"flow\"",
                           config.texture);
  if (nn::CanHalve(image_size, config.code.levels)) return {};
  return InvalidArgument(
      "pictures of {} pixels a side cannot be halved {} times to at least two "
      "pixels: choose another network.levels or photographs.size",
      image_size, config.code.levels);
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
      texture_size_(image_size << config.code.enlarge),
      sphere_(context, config.sphere) {
  Rng rng(seed, /*stream=*/0x70686f74);
  const bool flow = config.texture == "flow";
  const nn::UNetShape unet = UNetOf(
      config.code, {.in = 3, .out = flow ? 2 : 3, .output = flow ? &nn::Tanh : &nn::Sigmoid});
  all_.code.emplace(
      context, unet,
      PictureCodeShape{.image_size = image_size, .latent = config.code.latent, .layers = 2}, rng);
  BuildHeads(rng);
  StartShape(start);
  if (config.symmetric_texture) mirror_ = MirrorColumns(context, texture_size_);
}

void PhotographNetwork::BuildHeads(Rng& rng) {
  const std::int64_t latent = config_.code.latent;
  auto& offsets = nn::AddLinear(all_.shape, "fc", context_, latent, sphere_.numbers(), rng);
  nn::FillNormal(offsets.weight.value(), rng, config_.output_deviation);
  nn::FillConstant(offsets.bias.value(), 0);
  const std::int64_t count = config_.azimuths, logits = count > 1 ? count : 0;
  auto& camera =
      nn::AddLinear(all_.camera, "fc", context_, latent, count * CameraNumbers() + logits, rng);
  std::vector<double> start;
  for (int k = 0; k < count; ++k) {
    const std::vector<double> numbers = StartingNumbers(k);
    start.insert(start.end(), numbers.begin(), numbers.end());
  }
  start.resize(static_cast<std::size_t>(count * CameraNumbers() + logits));
  camera.bias.value() =
      context_.From({static_cast<std::int64_t>(start.size())}, std::span<const double>(start));
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

std::int64_t PhotographNetwork::CameraNumbers() const {
  return turns_by_rows() ? kWeakNumbers + 2 : kWeakNumbers;
}

// The bias of the last layer: an upright camera.
std::vector<double> PhotographNetwork::StartingNumbers(int k) const {
  std::vector<double> out(3, 0.0);
  const auto quaternion = StartingRotation(k, static_cast<int>(config_.azimuths));
  const std::array<double, 9> matrix = RotationOf(quaternion);
  if (turns_by_rows()) {
    out.insert(out.end(), matrix.begin(), matrix.begin() + 6);
  } else {
    out.insert(out.end(), quaternion.begin(), quaternion.end());
  }
  return out;
}

// Scale, shift and quaternion from the last layer's output.
nn::Var PhotographNetwork::CamerasOf(const nn::Var& raw) const {
  const nn::Var rotation = nn::Slice(raw, 1, 3, CameraNumbers());
  return nn::Concat(
      {kStartScale * nn::Exp(nn::Tanh(nn::Slice(raw, 1, 0, 1))), nn::Slice(raw, 1, 1, 3),
       turns_by_rows() ? QuaternionsOfRows(rotation) : UnitRows(rotation)},
      1);
}

void PhotographNetwork::Cameras(const nn::Var& latent, nn::Mode mode, Prediction* out) {
  const nn::Var raw = all_.camera.Forward(latent, mode);
  const std::int64_t count = config_.azimuths, numbers = count * CameraNumbers();
  if (count == 1 || !raw.valid()) {
    out->cameras = raw.valid() ? CamerasOf(raw) : raw;
    return;
  }
  const std::int64_t rows = raw.shape()[0] * count;
  out->choice_logits = nn::Slice(raw, 1, numbers, numbers + count);
  out->camera_choices =
      CamerasOf(nn::Reshape(nn::Slice(raw, 1, 0, numbers), {rows, CameraNumbers()}));
  const std::vector<std::int32_t> likeliest = Likeliest(out->choice_logits.value());
  out->cameras = nn::Gather(out->camera_choices, 0, context_.Indices(likeliest));
}

Prediction PhotographNetwork::Forward(const nn::Var& pictures, nn::Mode mode) {
  Prediction out;
  const PictureCode::Encoded encoded = all_.code->Encode(pictures, mode);
  if (!encoded.latent.valid()) return out;
  out.movement = sphere_.Movement(all_.shape.Forward(encoded.latent, mode));
  out.positions = MeanShape() + out.movement;
  out.keypoints = Keypoints(out.positions);
  Cameras(encoded.latent, mode, &out);
  Texture(encoded, mode, &out);
  return out;
}

}  // namespace tilegrad::train
