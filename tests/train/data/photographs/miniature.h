// SPDX-License-Identifier: Apache-2.0
// A few photographs in the layout of CUB-200 or PASCAL3D+ for tests: pictures of a coloured bar on
// noise, whose keypoints and cameras are known.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/rng.h"
#include "io/image_file.h"
#include "scene/weak_perspective_ref.h"
#include "train/data/photographs/photographs.h"

namespace tilegrad::train {

// Symmetric in x by the set's mirror map.
inline std::vector<std::array<double, 3>> MiniatureShape(const std::vector<int>& mirror) {
  std::vector<std::array<double, 3>> out(mirror.size());
  Rng rng(11);
  for (std::size_t k = 0; k < mirror.size(); ++k) {
    const auto m = static_cast<std::size_t>(mirror[k]);
    if (m < k) {
      out[k] = {-out[m][0], out[m][1], out[m][2]};
      continue;
    }
    out[k] = {m == k ? 0 : rng.Uniform(0.1, 0.35), rng.Uniform(-0.3, 0.3), rng.Uniform(-0.9, 0.9)};
  }
  return out;
}

struct MiniatureSize {
  int train = 10, test = 3, width = 60, height = 48;
  double stretch = 0;  // lengths differ by up to this either way, as the green of the bars tells
};

// A random view of the shape, the whole of it within the picture.
inline Photograph MiniaturePhoto(const PhotographSet& set, int index, const MiniatureSize& size) {
  const auto [width, height] = std::pair(size.width, size.height);
  Rng rng(7, static_cast<std::uint64_t>(index));
  Photograph photo;
  photo.id = "001.Bar/bar_" + std::to_string(index) + ".png";
  const double turn = rng.Uniform(0, 6.28);
  photo.camera = WeakPerspective{
      0.36 * height, {0.5 * width, 0.5 * height}, {0.1, std::cos(turn / 2), 0, std::sin(turn / 2)}};
  photo.mask = {width, height, std::vector<bool>(static_cast<std::size_t>(width * height))};
  photo.box = {1e9, 1e9, -1e9, -1e9};
  for (std::size_t k = 0; k < set.mean_keypoints.size(); ++k) {
    auto p = set.mean_keypoints[k];
    p[2] *= 1 + size.stretch * (index % 10 - 4.5) / 4.5;
    const auto seen = ProjectWeakly(*photo.camera, p);
    photo.keypoints.push_back({seen[0], seen[1], rng.Uniform() < 0.8});
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (std::hypot(x + 0.5 - seen[0], y + 0.5 - seen[1]) > 4) continue;
        photo.mask.inside[static_cast<std::size_t>(y * width + x)] = true;
        photo.box = {std::min(photo.box.left, x + 0.0), std::min(photo.box.top, y + 0.0),
                     std::max(photo.box.right, x + 1.0), std::max(photo.box.bottom, y + 1.0)};
      }
    }
  }
  return photo;
}

inline ImageU8 MiniaturePicture(const Photograph& photo, int index) {
  Rng rng(8, static_cast<std::uint64_t>(index));
  ImageU8 image(photo.mask.width, photo.mask.height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool inside = photo.mask.at(x, y);
      image.at(x, y)[0] = static_cast<std::uint8_t>(inside ? 220 : rng.Below(256));
      image.at(x, y)[1] = static_cast<std::uint8_t>(inside ? 60 + 10 * (index % 10) : 90);
      image.at(x, y)[2] = static_cast<std::uint8_t>(inside ? 40 : rng.Below(256));
    }
  }
  return image;
}

// source: "cub" or "pascal3d". Writes pictures and annotations to `folder` as its owners have them.
inline PhotographSet WriteMiniature(const Path& folder, const std::string& source,
                                    const MiniatureSize& size = {}) {
  PhotographSet set;
  set.source = source;
  set.class_name = source == "cub" ? "" : "car";
  const bool cub = source == "cub";
  set.mirror = cub ? CubMirror() : std::vector<int>{1, 0, 3, 2, 5, 4, 6, 7};
  for (std::size_t k = 0; k < set.mirror.size(); ++k)
    set.keypoint_names.push_back(cub ? kCubKeypoints[k] : "part" + std::to_string(k));
  set.mean_keypoints = MiniatureShape(set.mirror);
  const Path pictures = folder / (cub ? "CUB_200_2011/images" : "PASCAL3D+_release1.1/Images");
  for (int i = 0; i < size.train + size.test; ++i) {
    Photograph photo = MiniaturePhoto(set, i, size);
    photo.split = i < size.train ? Split::kTrain : Split::kTest;
    photo.image = pictures / photo.id;
    std::filesystem::create_directories(photo.image.parent_path());
    const Status saved = io::SavePng(photo.image, MiniaturePicture(photo, i));
    if (!saved.ok()) std::abort();
    set.photographs.push_back(std::move(photo));
  }
  const Path base = folder / (cub ? "cachedir/cub" : "cachedir/p3d");
  if (!WriteCmrLayout(base, set).ok()) std::abort();
  return set;
}

}  // namespace tilegrad::train
