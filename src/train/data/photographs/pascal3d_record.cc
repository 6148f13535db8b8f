// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/pascal3d_record.h"

#include <algorithm>
#include <glm/gtc/quaternion.hpp>

#include "base/error.h"

namespace tilegrad::train {
namespace {

using io::MatPlace;

constexpr double kMostCad = 1e6;  // models of a class; damaged files may say anything

// Many fields are there for some objects only, or empty.
double NumberOr(const MatPlace& record, std::size_t index, const char* name, double otherwise) {
  const auto field = record.Field(index, name);
  if (!field.ok()) return otherwise;
  const auto number = field->Number();
  return number.ok() ? *number : otherwise;
}

Pascal3dViewpoint ReadViewpoint(const MatPlace& place, const PhotoBox& box) {
  Pascal3dViewpoint out;
  out.azimuth = NumberOr(place, 0, "azimuth", 0);
  out.elevation = NumberOr(place, 0, "elevation", 0);
  out.theta = NumberOr(place, 0, "theta", 0);
  out.distance = NumberOr(place, 0, "distance", 0);
  out.focal = NumberOr(place, 0, "focal", out.focal);
  out.viewport = NumberOr(place, 0, "viewport", out.viewport);
  out.px = NumberOr(place, 0, "px", (box.left + box.right) / 2 + 0.5);
  out.py = NumberOr(place, 0, "py", (box.top + box.bottom) / 2 + 0.5);
  return out;
}

// `location` is empty and `status` another number than 1 where it is not seen.
Result<std::map<std::string, Keypoint>> ReadAnchors(const MatPlace& anchors) {
  constexpr double kVisible = 1;
  std::map<std::string, Keypoint> out;
  for (const std::string& name : anchors.array().fields) {
    TILEGRAD_ASSIGN(const MatPlace anchor, anchors.Field(0, name));
    Keypoint& keypoint = out[name];
    if (NumberOr(anchor, 0, "status", 0) != kVisible) continue;
    TILEGRAD_ASSIGN(const MatPlace location, anchor.Field(0, "location"));
    TILEGRAD_ASSIGN(const auto at, location.Numbers(2));
    keypoint = {at[0] - 0.5, at[1] - 0.5, true};
  }
  return out;
}

// Of a struct that is not empty.
std::optional<MatPlace> StructField(const MatPlace& record, std::size_t index, const char* name) {
  auto field = record.Field(index, name);
  if (!field.ok() || !field->ExpectStruct().ok() || field->places() == 0) return std::nullopt;
  return std::move(*field);
}

Result<Pascal3dObject> ReadObject(const MatPlace& objects, std::size_t index) {
  Pascal3dObject out;
  out.number = static_cast<int>(index) + 1;
  out.cad = static_cast<int>(std::clamp(NumberOr(objects, index, "cad_index", 0), 0.0, kMostCad));
  for (const char* flaw : {"truncated", "occluded", "difficult"})
    out.whole = out.whole && NumberOr(objects, index, flaw, 0) == 0;
  TILEGRAD_ASSIGN(const MatPlace bbox, objects.Field(index, "bbox"));
  TILEGRAD_ASSIGN(const auto b, bbox.Numbers(4));
  out.box = {b[0] - 1, b[1] - 1, b[2], b[3]};
  if (!(out.box.right - out.box.left >= 1 && out.box.bottom - out.box.top >= 1))
    return InvalidArgument("{}: an empty box", bbox.where());
  if (const auto viewpoint = StructField(objects, index, "viewpoint"))
    out.viewpoint = ReadViewpoint(*viewpoint, out.box);
  if (const auto anchors = StructField(objects, index, "anchors")) {
    TILEGRAD_ASSIGN(out.anchors, ReadAnchors(*anchors));
  }
  return out;
}

glm::dmat3 TurnAbout(double degrees, const glm::dvec3& axis) {
  return glm::mat3_cast(glm::angleAxis(glm::radians(degrees), axis));
}

}  // namespace

Result<Pascal3dRecord> ReadPascal3dRecord(const io::MatFile& file, const std::string& class_name) {
  Pascal3dRecord out;
  TILEGRAD_ASSIGN(const MatPlace record, MatPlace::Variable(file, "record"));
  TILEGRAD_ASSIGN(const MatPlace name, record.Field(0, "filename"));
  TILEGRAD_ASSIGN(out.file, name.Text());
  if (Path(out.file).filename() != out.file)
    return InvalidArgument("{}: \"{}\" is no name of a file", name.where(), out.file);
  TILEGRAD_ASSIGN(const MatPlace objects, record.Field(0, "objects"));
  TILEGRAD_TRY(objects.ExpectStruct());
  for (std::size_t i = 0; i < objects.places(); ++i) {
    TILEGRAD_ASSIGN(const MatPlace of_class, objects.Field(i, "class"));
    const auto text = of_class.Text();
    if (!text.ok() || *text != class_name) continue;
    TILEGRAD_ASSIGN(auto object, ReadObject(objects, i));
    out.objects.push_back(std::move(object));
  }
  return out;
}

// The set's project_3d.m: the camera is at distance * (cos e sin a, -cos e cos a, sin e) and looks
// at the origin; what it sees is turned by theta about the principal point.
Camera64 CameraOfViewpoint(const Pascal3dViewpoint& viewpoint) {
  constexpr glm::dvec3 kX(1, 0, 0), kZ(0, 0, 1);
  const glm::dmat3 from_ours = TurnAbout(90, kX);
  const glm::dmat3 rotation = TurnAbout(viewpoint.theta, kZ) *
                              TurnAbout(viewpoint.elevation - 90, kX) *
                              TurnAbout(-viewpoint.azimuth, kZ) * from_ours;
  Camera64 out;
  for (int i = 0; i < 9; ++i) out.rotation[i] = rotation[i % 3][i / 3];
  out.translation[2] = -viewpoint.distance;
  out.fx = out.fy = viewpoint.focal * viewpoint.viewport;
  out.cx = viewpoint.px - 0.5;
  out.cy = viewpoint.py - 0.5;
  return out;
}

}  // namespace tilegrad::train
