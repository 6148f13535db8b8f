// SPDX-License-Identifier: Apache-2.0
// A few photographs in the layout in which PASCAL3D+ is published (release 1.1), of a shape of our
// own: names, folders, numbers from (1, 1), axes (z up, front towards -y) and the projection are
// written down here once more, from the set's project_3d.m.
#pragma once

#include <stb_image_write.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>

#include "base/rng.h"
#include "io/image_file.h"
#include "io/mat_file.h"
#include "train/data/photographs/photographs.h"
#include "train/data/photographs/rendered_set.h"
#include "train/data/sources/model_source.h"

namespace tilegrad::train {

using Place3 = std::array<double, 3>;

// Whether a pixel's centre lies in a triangle of the projected mesh.
inline PhotoMask Filled(const Mesh& mesh, const std::vector<std::array<double, 2>>& seen, int width,
                        int height) {
  PhotoMask mask{width, height, std::vector<bool>(static_cast<std::size_t>(width * height))};
  for (const auto& face : mesh.faces) {
    const auto &a = seen[static_cast<std::size_t>(face[0])],
               &b = seen[static_cast<std::size_t>(face[1])],
               &c = seen[static_cast<std::size_t>(face[2])];
    const auto side = [](const auto& p, const auto& q, double x, double y) {
      return (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    };
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double u = side(a, b, x + 0.5, y + 0.5), v = side(b, c, x + 0.5, y + 0.5),
                     w = side(c, a, x + 0.5, y + 0.5);
        if ((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0))
          mask.inside[static_cast<std::size_t>(y * width + x)] = true;
      }
    }
  }
  return mask;
}

class Pascal3dMiniature {
 public:
  static constexpr int kWidth = 96, kHeight = 72;

  // `train` and `test` pictures of car_imagenet, and two of car_pascal with two cars each, of which
  // one is truncated.
  Pascal3dMiniature(const Path& folder, int train, int test)
      : root_(folder / "PASCAL3D+_release1.1"), mesh_(ProceduralModel(0, 1, 1)) {
    for (const glm::vec3& p : FindExtremePoints(mesh_)) anchors_.push_back({p.x, -p.z, p.y});
    for (const ExtremePoint& point : kExtremePoints) {
      std::string name = point.name;
      std::ranges::replace(name, ' ', '_');
      names_.push_back(name);
    }
    WriteCad();
    std::string lists[2], voc[2];
    for (int i = 0; i < train + test; ++i) {
      const std::string name = "n02814533_" + std::to_string(100 + i);
      WritePicture("car_imagenet", name, ".JPEG", i, 1);
      lists[i < train ? 0 : 1] += name + "\n";
    }
    for (int i = 0; i < 2; ++i) {
      const std::string name = "2008_00000" + std::to_string(i);
      WritePicture("car_pascal", name, ".jpg", 1000 + i, 2);
      voc[i] = name + "\n";
    }
    WriteText("Image_sets/car_imagenet_train.txt", lists[0]);
    WriteText("Image_sets/car_imagenet_val.txt", lists[1]);
    WriteText("PASCAL/VOCdevkit/VOC2012/ImageSets/Main/train.txt", voc[0]);
    WriteText("PASCAL/VOCdevkit/VOC2012/ImageSets/Main/val.txt", voc[1]);
    std::filesystem::create_directories(root_ / "Annotations/boat_imagenet");
  }

  const Path& root() const { return root_; }
  const Mesh& mesh() const { return mesh_; }                       // in the project's world
  const std::vector<Place3>& anchors() const { return anchors_; }  // in the set's world
  // By the picture's path and the object's number.
  const std::map<std::pair<std::string, int>, PhotoMask>& masks() const { return masks_; }

 private:
  struct View {
    double azimuth, elevation, theta, distance, px, py;
  };

  static View ViewOf(int index, int object, int objects) {
    Rng rng(21, static_cast<std::uint64_t>(10 * index + object));
    const double middle = kWidth * (object + 0.5) / objects + 0.5;
    return {rng.Uniform(0, 360),           rng.Uniform(-5, 30),         rng.Uniform(-8, 8),
            rng.Uniform(55, 65) * objects, middle + rng.Uniform(-2, 2), 36 + rng.Uniform(-2, 2)};
  }

  // Of MATLAB: the first pixel's centre is (1, 1).
  static std::array<double, 2> Project(const View& view, const Place3& x) {
    constexpr double kDegree = std::numbers::pi / 180, kViewport = 3000;
    const double a = view.azimuth * kDegree, e = view.elevation * kDegree, t = view.theta * kDegree;
    const Place3 c = {view.distance * std::cos(e) * std::sin(a),
                      -view.distance * std::cos(e) * std::cos(a), view.distance * std::sin(e)};
    const Place3 d = {x[0] - c[0], x[1] - c[1], x[2] - c[2]};
    const double turn = -a, tilt = e - std::numbers::pi / 2;
    const Place3 z = {std::cos(turn) * d[0] - std::sin(turn) * d[1],
                      std::sin(turn) * d[0] + std::cos(turn) * d[1], d[2]};
    const Place3 p = {z[0], std::cos(tilt) * z[1] - std::sin(tilt) * z[2],
                      std::sin(tilt) * z[1] + std::cos(tilt) * z[2]};
    const double u = kViewport * p[0] / -p[2], v = kViewport * p[1] / -p[2];
    return {std::cos(t) * u - std::sin(t) * v + view.px,
            -(std::sin(t) * u + std::cos(t) * v) + view.py};
  }

  void WriteText(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text;
  }

  void WriteCad() const {
    std::vector<double> vertices, faces, none = {0, 0, 0, 1, 0, 0, 0, 1, 0}, one = {1, 2, 3};
    for (int axis : {0, 2, 1}) {
      for (const glm::vec3& p : mesh_.positions) vertices.push_back(axis == 2 ? -p[2] : p[axis]);
    }
    for (int corner = 0; corner < 3; ++corner) {
      for (const auto& face : mesh_.faces)
        faces.push_back(face[static_cast<std::size_t>(corner)] + 1);
    }
    using io::MatArray;
    const auto models = MatArray::Structs(
        {"vertices", "faces"}, {MatArray::Numbers({3, 3}, none), MatArray::Numbers({1, 3}, one),
                                MatArray::Numbers({mesh_.positions.size(), 3}, vertices),
                                MatArray::Numbers({mesh_.faces.size(), 3}, faces)});
    if (!io::SaveMat(root_ / "CAD/car.mat", {{"car", models}}).ok()) std::abort();
  }

  io::MatArray AnchorsOf(const View& view, Rng& rng) const {
    using io::MatArray;
    std::vector<MatArray> anchors;
    for (const Place3& place : anchors_) {
      const bool seen = rng.Uniform() < 0.8;
      const auto at = Project(view, place);
      anchors.push_back(MatArray::Structs(
          {"location", "status"},
          {seen ? MatArray::Numbers({1, 2}, at) : MatArray(), MatArray::Number(seen ? 1 : 2)}));
    }
    return MatArray::Structs(names_, std::move(anchors));
  }

  // The fields of one object; keeps its mask.
  std::vector<io::MatArray> Object(const std::string& id, const View& view, int number, Rng& rng) {
    using io::MatArray;
    std::vector<std::array<double, 2>> seen;
    for (const glm::vec3& p : mesh_.positions) {
      const auto at = Project(view, {p.x, -p.z, p.y});
      seen.push_back({at[0] - 0.5, at[1] - 0.5});
    }
    masks_[{id, number}] = Filled(mesh_, seen, kWidth, kHeight);
    std::array<double, 4> box = {1e9, 1e9, -1e9, -1e9};
    for (const auto& at : seen) {
      box = {std::min(box[0], at[0] + 0.5), std::min(box[1], at[1] + 0.5),
             std::max(box[2], at[0] + 0.5), std::max(box[3], at[1] + 0.5)};
    }
    const auto viewpoint = MatArray::Structs(
        {"azimuth_coarse", "elevation_coarse", "azimuth", "elevation", "distance", "focal", "px",
         "py", "theta", "viewport"},
        {MatArray::Number(std::round(view.azimuth)), MatArray::Number(std::round(view.elevation)),
         MatArray::Number(view.azimuth), MatArray::Number(view.elevation),
         MatArray::Number(view.distance), MatArray::Number(1), MatArray::Number(view.px),
         MatArray::Number(view.py), MatArray::Number(view.theta), MatArray::Number(3000)});
    return {
        MatArray::Text("car"), MatArray::Numbers({1, 4}, box), AnchorsOf(view, rng), viewpoint,
        MatArray::Number(2),   MatArray::Number(number > 1),   MatArray::Number(0),  MatArray()};
  }

  void WritePicture(const std::string& folder, const std::string& name, const char* ending,
                    int index, int objects) {
    using io::MatArray;
    const std::string id = folder + "/" + name + ending;
    Rng rng(22, static_cast<std::uint64_t>(index));
    std::vector<MatArray> fields;
    for (int k = 0; k < objects; ++k) {
      auto own = Object(id, ViewOf(index, k, objects), k + 1, rng);
      std::ranges::move(own, std::back_inserter(fields));
    }
    ImageU8 image(kWidth, kHeight, 3, 90), classes(kWidth, kHeight, 3, 0);
    for (int k = 0; k < objects; ++k) {
      const PhotoMask& mask = masks_[{id, k + 1}];
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          if (!mask.at(x, y)) continue;
          image.at(x, y)[0] = 220;
          // PASCAL VOC's palette: dark red, dark green.
          for (int c = 0; c < 3; ++c) classes.at(x, y)[c] = c == k ? 128 : 0;
          // What is in front hides the other.
          for (int other = 0; other < k; ++other)
            masks_[{id, other + 1}].inside[static_cast<std::size_t>(y * kWidth + x)] = false;
        }
      }
    }
    std::filesystem::create_directories(root_ / "Images" / folder);
    stbi_write_jpg((root_ / "Images" / id).c_str(), kWidth, kHeight, 3, image.pixels.data(), 90);
    if (objects > 1) {
      const Path voc = root_ / "PASCAL/VOCdevkit/VOC2012/SegmentationObject" / (name + ".png");
      if (!io::SavePng(voc, classes).ok()) std::abort();
    }
    const auto record =
        MatArray::Structs({"filename", "imgsize", "objects"},
                          {MatArray::Text(name + ending),
                           MatArray::Numbers({1, 3}, std::vector<double>{kWidth, kHeight, 3}),
                           MatArray::Structs({"class", "bbox", "anchors", "viewpoint", "cad_index",
                                              "truncated", "occluded", "difficult"},
                                             std::move(fields))});
    const Path file = root_ / "Annotations" / folder / (name + ".mat");
    if (!io::SaveMat(file, {{"record", record}}).ok()) std::abort();
  }

  Path root_;
  Mesh mesh_;
  std::vector<Place3> anchors_;
  std::vector<std::string> names_;
  std::map<std::pair<std::string, int>, PhotoMask> masks_;
};

}  // namespace tilegrad::train
