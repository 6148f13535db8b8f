// SPDX-License-Identifier: Apache-2.0
// Files of cameras, and the cameras of glTF files.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <tuple>
#include <utility>

#include "bindings/camera_numbers.h"
#include "bindings/to_python.h"
#include "io/camera_file.h"

namespace tilegrad::python {

void BindCameraFiles(py::module_& m);

namespace {

using Size = std::pair<int, int>;                            // width, height
using ViewTuple = std::tuple<std::string, CameraRow, Size>;  // as Python has it: with its name

ImageSize SizeOf(const Size& size) { return {size.first, size.second}; }

py::array RowOf(const Camera64& camera) {
  return CopyOf<double>(NumbersOf(camera), {static_cast<py::ssize_t>(kCameraNumbers)});
}

py::list LoadCameras(const Path& path, const Size& size, bool half) {
  std::string note;
  io::CameraFileOptions options = {SizeOf(size), half ? PixelCentre::kHalf : PixelCentre::kInteger};
  options.warn = [&note](const std::string& warning) { note = warning; };
  const auto views = ValueOrThrow(WithoutGil([&] { return io::LoadCameras(path, options); }));
  if (!note.empty()) WarnUser("load_cameras: " + note);
  py::list out;
  for (const io::CameraView& view : views) {
    out.append(py::make_tuple(Text(view.name), RowOf(view.camera),
                              Size(view.size.width, view.size.height)));
  }
  return out;
}

void SaveCameras(const Path& path, const std::string& format, const std::vector<ViewTuple>& list) {
  std::vector<io::CameraView> views;
  for (const auto& [name, numbers, size] : list)
    views.push_back({name, CameraOfNumbers(numbers), SizeOf(size)});
  for (const io::CameraView& view : views)
    ThrowIfError(Validate(view.camera).Within("save_cameras: " + view.name));
  ThrowIfError(WithoutGil([&] {
    if (format == "colmap") return io::SaveColmapCameras(path, views);
    return format == "nerf" ? io::SaveNerfCameras(path, views) : io::SaveOpenCvCameras(path, views);
  }));
}

// lens: yfov, aspect ratio, near plane.
py::array FromGltf(const Mat4Array& node_to_world, const Vec3Array& lens, const Size& size) {
  const GltfCamera camera = {node_to_world, lens[0], lens[1], lens[2]};
  const auto made = tilegrad::FromGltf(camera, SizeOf(size));
  ThrowIfError(made.status().Within("MeshCamera.camera"));
  return RowOf(*made);
}

}  // namespace

void BindCameraFiles(py::module_& m) {
  m.def("load_cameras", &LoadCameras, py::arg("path"), py::arg("size"), py::arg("half"),
        "(name, 17 numbers, (width, height)) of each camera of a file or folder.");
  m.def("save_cameras", &SaveCameras, py::arg("path"), py::arg("format"), py::arg("views"),
        "Writes what load_cameras returns, as \"opencv\", \"nerf\" or \"colmap\".");
  m.def("from_gltf", &FromGltf, py::arg("node_to_world"), py::arg("lens"), py::arg("size"),
        "17 numbers of a glTF camera: 16 numbers row by row, (yfov, aspect ratio, near plane).");
  m.def(
      "rotation_from_vector",
      [](const Vec3Array& rvec) {
        return CopyOf<double>(RotationFromVector(rvec), {3, 3});
      },
      py::arg("rvec"), "(3, 3) from OpenCV's rotation vector.");
}

}  // namespace tilegrad::python
