// SPDX-License-Identifier: Apache-2.0
// Images: PNG, JPEG and others as uint8, EXR as float32, NPY as it is.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings/npy_arrays.h"
#include "bindings/to_python.h"
#include "io/exr_file.h"
#include "io/image_file.h"

namespace tilegrad::python {

void BindImages(py::module_& m);

namespace {

py::array LoadImage(const Path& path, std::size_t max_bytes) {
  ImageU8 image = LoadWithin(max_bytes, [&] { return io::LoadImage(path); });
  return OwnedArray<std::uint8_t>(std::move(image.pixels),
                                  {image.height, image.width, image.channels});
}

// pixels: [height,width,channels] uint8.
void SavePng(const Path& path, const py::object& pixels) {
  const auto values = SpanOf<std::uint8_t>(pixels, "save_image", "image", {kAny, kAny, kAny});
  const auto array = py::reinterpret_borrow<py::array>(pixels);
  ImageU8 image(static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
                static_cast<int>(array.shape(2)));
  std::copy(values.begin(), values.end(), image.pixels.begin());
  ThrowIfError(WithoutGil([&] { return io::SavePng(path, image).Within(path.string()); }));
}

// Names of channels, [channels,height,width] float32, and warnings.
py::tuple LoadExr(const Path& path, std::size_t max_bytes) {
  io::LoadedExr image = LoadWithin(max_bytes, [&] { return io::LoadExr(path); });
  const auto channels = static_cast<py::ssize_t>(image.names.size());
  py::list names, warnings;
  for (const std::string& name : image.names) names.append(Text(name));
  for (const std::string& warning : image.warnings) warnings.append(Text(warning));
  return py::make_tuple(
      names, OwnedArray<float>(std::move(image.values), {channels, image.height, image.width}),
      warnings);
}

void SaveExr(const Path& path, const std::vector<std::string>& names, const py::object& planes) {
  const auto values = SpanOf<float>(planes, "save_image", "image",
                                    {static_cast<py::ssize_t>(names.size()), kAny, kAny});
  const auto array = py::reinterpret_borrow<py::array>(planes);
  io::ExrImage image{static_cast<int>(array.shape(2)), static_cast<int>(array.shape(1)), {}};
  const std::size_t size = names.empty() ? 0 : values.size() / names.size();
  for (std::size_t c = 0; c < names.size(); ++c)
    image.channels.push_back({names[c], values.subspan(c * size, size)});
  ThrowIfError(WithoutGil([&] { return io::SaveExr(path, image).Within(path.string()); }));
}

py::array LoadNpy(const Path& path, std::size_t max_bytes) {
  return NpyToPython(LoadWithin(max_bytes, [&] { return io::LoadNpy(path); }));
}

void SaveNpy(const Path& path, const py::object& array) {
  const Bytes bytes = io::EncodeNpy(NpyFromPython("save_image", "image", array));
  ThrowIfError(WithoutGil([&] { return WriteFileAtomic(path, bytes); }));
}

}  // namespace

void BindImages(py::module_& m) {
  m.def("load_image", &LoadImage, py::arg("path"), py::arg("max_bytes") = 0, "(H, W, C) uint8.");
  m.def("save_png", &SavePng, py::arg("path"), py::arg("pixels"), "Writes (H, W, C) uint8.");
  m.def("load_exr", &LoadExr, py::arg("path"), py::arg("max_bytes") = 0,
        "Names of channels, (C, H, W) float32, and what of the file is left out.");
  m.def("save_exr", &SaveExr, py::arg("path"), py::arg("names"), py::arg("planes"),
        "Writes (C, H, W) float32 with names of channels.");
  m.def("load_npy", &LoadNpy, py::arg("path"), py::arg("max_bytes") = 0,
        "The array of an .npy file.");
  m.def("save_npy", &SaveNpy, py::arg("path"), py::arg("array"), "Writes an .npy file.");
}

}  // namespace tilegrad::python
