// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "cli/command.h"
#include "cli/console.h"
#include "cli/render_job.h"
#include "scene/camera.h"
#include "scene/mesh.h"

namespace tilegrad::cli {
namespace {

using io::CameraView;

constexpr int kDefaultSize = 512;

// "512" or "640x480"; nothing gives 0 x 0.
Result<ImageSize> ParseSize(const std::string& text) {
  if (text.empty()) return ImageSize{};
  ImageSize size;
  const char* const end = text.data() + text.size();
  std::from_chars_result parsed = std::from_chars(text.data(), end, size.width);
  size.height = size.width;
  if (parsed.ec == std::errc() && parsed.ptr != end && (*parsed.ptr == 'x' || *parsed.ptr == 'X'))
    parsed = std::from_chars(parsed.ptr + 1, end, size.height);
  if (parsed.ec != std::errc() || parsed.ptr != end || size.width < 1 || size.height < 1) {
    return InvalidArgument("--size \"{}\": expected pixels, as 512 or 640x480", text);
  }
  return size;
}

ImageSize OrDefault(ImageSize size) {
  return size.width > 0 ? size : ImageSize{kDefaultSize, kDefaultSize};
}

// Letters that every file system takes; the ending is dropped.
std::string FileStem(const std::string& name) {
  std::string stem = Path(name).replace_extension().generic_string();
  while (stem.starts_with("./") || stem.starts_with("/")) stem.erase(0, stem.find('/') + 1);
  std::replace_if(
      stem.begin(), stem.end(),
      [](unsigned char c) { return !(std::isalnum(c) || c == '-' || c == '_' || c == '.'); }, '_');
  return stem;
}

// Names become names of files, each once.
void NameFiles(std::vector<CameraView>* views) {
  UniqueNames names;
  for (std::size_t i = 0; i < views->size(); ++i) {
    const std::string name = FileStem((*views)[i].name);
    (*views)[i].name = names.Take(name.empty() ? std::to_string(i) : name);
  }
}

Result<std::vector<CameraView>> FileViews(const ViewSettings& settings, ImageSize size) {
  const auto centre = settings.opencv_centre == "half" ? PixelCentre::kHalf : PixelCentre::kInteger;
  const auto warn = [](const std::string& note) { PrintNote("tilegrad: warning: {}\n", note); };
  const io::CameraFileOptions options = {size, centre, false, warn};
  TILEGRAD_ASSIGN(auto views, io::LoadCameras(settings.camera_file, options));
  for (CameraView& view : views) {
    if (size.width == 0) continue;
    view.camera = ResizeCamera(view.camera, view.size, size);
    view.size = size;
  }
  return views;
}

Result<std::vector<CameraView>> GltfViews(const ViewSettings& settings, const io::LoadedMesh& mesh,
                                          ImageSize size) {
  if (mesh.cameras.empty())
    return InvalidArgument("--gltf-camera: there is no perspective camera in the file");
  std::vector<CameraView> views;
  std::string known;
  for (std::size_t i = 0; i < mesh.cameras.size(); ++i) {
    io::MeshFileCamera from = mesh.cameras[i];
    known += fmt::format("{}{} \"{}\"", i > 0 ? ", " : "", i, from.name);
    const bool wanted = settings.gltf_camera == "all" || settings.gltf_camera == from.name ||
                        settings.gltf_camera == std::to_string(i);
    if (!wanted) continue;
    from.camera.aspect_ratio = 0;  // pixels are square, as viewers do it
    const auto camera = FromGltf(from.camera, size);
    if (!camera.ok())
      return DataLoss("camera {} \"{}\": {}", i, from.name, camera.status().message());
    views.push_back({from.name.empty() ? fmt::format("camera{}", i) : from.name, *camera, size});
  }
  if (views.empty()) {
    return InvalidArgument("--gltf-camera \"{}\": the file has {}", settings.gltf_camera, known);
  }
  return views;
}

// X,Y,Z, or the direction of an axis.
Result<std::array<double, 3>> UpOf(const ViewSettings& s) {
  std::vector<double> numbers;
  const std::vector<std::string> words = PartsBetweenCommas(s.up);
  for (const std::string& word : words) {
    if (const auto number = RealNumber(word)) numbers.push_back(*number);
  }
  if (words.size() == 3 && numbers.size() == 3)
    return std::array<double, 3>{numbers[0], numbers[1], numbers[2]};
  TILEGRAD_ASSIGN(const UpAxis axis, UpAxisOf(s));
  return std::array<double, 3>{axis == UpAxis::kX ? 1.0 : 0, axis == UpAxis::kY ? 1.0 : 0,
                               axis == UpAxis::kZ ? 1.0 : 0};
}

Result<std::vector<CameraView>> LookAtView(const ViewSettings& s, ImageSize size) {
  const Lens lens{s.fov, size.width, size.height};
  if (std::equal(s.eye.begin(), s.eye.end(), s.target.begin()))
    return InvalidArgument("--eye and --target are the same point");
  TILEGRAD_ASSIGN(const auto up, UpOf(s));
  const Camera64 camera = LookAtCamera(lens, s.eye.data(), s.target.data(), up.data());
  TILEGRAD_TRY(Validate(camera).Within("--eye, --target, --up"));
  return std::vector<CameraView>{{"", camera, size}};
}

Result<std::vector<CameraView>> FramedViews(const ViewSettings& s, const Mesh& mesh,
                                            ImageSize size) {
  const int count = std::max(1, s.turntable);
  std::vector<ViewAngle> angles;
  for (int i = 0; i < count; ++i) angles.push_back({s.azimuth - 360.0 * i / count, s.elevation});
  const Framing framing{{s.fov, size.width, size.height}, s.margin, s.distance};
  TILEGRAD_ASSIGN(const UpAxis axis, UpAxisOf(s));
  Mesh upright;
  upright.positions = mesh.positions;
  upright.faces = mesh.faces;
  TurnUpright(axis, &upright);
  TILEGRAD_ASSIGN(const auto cameras, FrameMesh(upright, framing, angles));
  std::vector<CameraView> views;
  for (int i = 0; i < count; ++i) {
    const Camera camera = CameraOfFile(axis, cameras[i]);
    views.push_back({fmt::format("{:04}", i), CameraCast<double>(camera), size});
  }
  return views;
}

double Dot(const glm::dvec3& a, const glm::dvec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

glm::dvec3 Cross(const glm::dvec3& a, const glm::dvec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace

// Far away, a rotation of float digits would put a camera that is written at -R^T t some tenths
// off: it is made one of double digits, about the place where the camera stands.
Camera64 MovedCamera(Camera64 camera, const glm::dvec3& by) {
  if (by == glm::dvec3(0)) return camera;
  double* const r = camera.rotation;
  const glm::dvec3 rows[] = {{r[0], r[1], r[2]}, {r[3], r[4], r[5]}, {r[6], r[7], r[8]}};
  const double* const t = camera.translation;
  const glm::dvec3 columns[] = {Cross(rows[1], rows[2]), Cross(rows[2], rows[0]),
                                Cross(rows[0], rows[1])};  // of the inverse, times the determinant
  const glm::dvec3 eye =
      (t[0] * columns[0] + t[1] * columns[1] + t[2] * columns[2]) / -Dot(rows[0], columns[0]);
  const glm::dvec3 x = rows[0] / std::sqrt(Dot(rows[0], rows[0]));
  const glm::dvec3 across = rows[1] - Dot(rows[1], x) * x;
  const glm::dvec3 y = across / std::sqrt(Dot(across, across));
  const glm::dvec3 units[] = {x, y, Cross(x, y)};
  for (int row = 0; row < 3; ++row) {
    for (int axis = 0; axis < 3; ++axis) r[3 * row + axis] = units[row][axis];
    camera.translation[row] = -Dot(units[row], eye + by);
  }
  return camera;
}

Result<UpAxis> UpAxisOf(const ViewSettings& settings) {
  if (const auto axis = UpAxisNamed(settings.up)) return *axis;
  return InvalidArgument("--up {}: y, z or x; with --eye also X Y Z", settings.up);
}

Result<std::vector<CameraView>> ChooseViews(const ViewSettings& settings,
                                            const io::LoadedMesh& mesh) {
  TILEGRAD_ASSIGN(const ImageSize size, ParseSize(settings.size));
  if (!(settings.fov > 0 && settings.fov < 180))
    return InvalidArgument("--fov {}: must be between 0 and 180 degrees", settings.fov);
  for (const auto& [name, value] :
       {std::pair("--azimuth", settings.azimuth), std::pair("--elevation", settings.elevation)}) {
    if (!std::isfinite(value)) return InvalidArgument("{} {}: must be degrees", name, value);
  }
  const ImageSize shown = OrDefault(size);
  auto views = !settings.camera_file.empty()   ? FileViews(settings, size)
               : !settings.gltf_camera.empty() ? GltfViews(settings, mesh, shown)
               : !settings.eye.empty()         ? LookAtView(settings, shown)
                                               : FramedViews(settings, mesh.mesh, shown);
  if (!views.ok()) return views;
  if (!settings.camera_file.empty() || !settings.eye.empty()) {
    for (CameraView& view : *views) view.camera = MovedCamera(view.camera, -mesh.origin);
  }
  NameFiles(&*views);
  return views;
}

}  // namespace tilegrad::cli
