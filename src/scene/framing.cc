// SPDX-License-Identifier: Apache-2.0
#include "scene/framing.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "base/error.h"

namespace tilegrad {
namespace {

// The distance that the eye needs along one view, and how far the mesh reaches towards it.
struct Reach {
  double distance = 0, towards_eye = -1e300;
};

// A vertex at (x, y, z) of the camera's axes, from the middle, is seen from distance d at
// fx |x| / (d - z) pixels from the centre.
Reach ReachOf(const Mesh& mesh, const Camera& camera, glm::dvec3 middle, const Framing& framing) {
  const double half_x = 0.5 * framing.lens.width * (1 - framing.margin) / camera.fx;
  const double half_y = 0.5 * framing.lens.height * (1 - framing.margin) / camera.fy;
  const float* r = camera.rotation;
  Reach reach;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t v : face) {
      const glm::dvec3 p = glm::dvec3(mesh.positions[v]) - middle;
      const double x = glm::dot(p, glm::dvec3(r[0], r[1], r[2]));
      const double y = glm::dot(p, glm::dvec3(r[3], r[4], r[5]));
      const double z = glm::dot(p, glm::dvec3(r[6], r[7], r[8]));
      reach.distance =
          std::max(reach.distance, z + std::max(std::abs(x) / half_x, std::abs(y) / half_y));
      reach.towards_eye = std::max(reach.towards_eye, z);
    }
  }
  return reach;
}

Camera MovedTo(Camera camera, glm::dvec3 middle, double distance) {
  const float* r = camera.rotation;
  const glm::dvec3 eye = middle + distance * glm::dvec3(r[6], r[7], r[8]);
  for (int i = 0; i < 3; ++i) {
    camera.translation[i] =
        static_cast<float>(-glm::dot(glm::dvec3(r[3 * i], r[3 * i + 1], r[3 * i + 2]), eye));
  }
  return camera;
}

Status Check(const Framing& framing, double extent) {
  const Lens& lens = framing.lens;
  if (!(lens.fov_y > 0 && lens.fov_y < 180))
    return InvalidArgument("a field of view of {} degrees; it must be between 0 and 180",
                           lens.fov_y);
  if (lens.width < 1 || lens.height < 1)
    return InvalidArgument("an image of {} x {} pixels", lens.width, lens.height);
  if (!(framing.margin >= 0 && framing.margin < 1))
    return InvalidArgument("a margin of {}; it must be in [0, 1)", framing.margin);
  if (!(framing.distance >= 0) || !std::isfinite(framing.distance))
    return InvalidArgument("a camera distance of {}; it must be 0 or above", framing.distance);
  if (!(extent > 0)) return InvalidArgument("the mesh has no extent, so no camera can frame it");
  return {};
}

}  // namespace

Result<std::vector<Camera>> FrameMesh(const Mesh& mesh, const Framing& framing,
                                      std::span<const ViewAngle> views) {
  const Bounds bounds = MeshBounds(mesh);
  const glm::dvec3 low(bounds.low), high(bounds.high), middle = 0.5 * (low + high);
  const double extent = glm::length(high - low);
  TILEGRAD_TRY(Check(framing, extent));
  std::vector<Camera> cameras;
  Reach all;
  for (const ViewAngle& view : views) {
    cameras.push_back(OrbitCamera(framing.lens, view.azimuth, view.elevation, 1));
    const Reach reach = ReachOf(mesh, cameras.back(), middle, framing);
    all.distance = std::max(all.distance, reach.distance);
    all.towards_eye = std::max(all.towards_eye, reach.towards_eye);
  }
  // Otherwise the eye would touch a line that points towards it.
  const double distance = framing.distance > 0
                              ? framing.distance
                              : std::max(all.distance, all.towards_eye + 0.1 * extent);
  for (Camera& camera : cameras) {
    camera = MovedTo(camera, middle, distance);
    camera.near_plane =
        static_cast<float>(std::max(1e-4 * distance, 0.5 * (distance - all.towards_eye)));
  }
  return cameras;
}

}  // namespace tilegrad
