// SPDX-License-Identifier: Apache-2.0
// Arrays from files and to files: images (PNG, JPEG and others as uint8, EXR as float32, NPY as it
// is), weights of networks (safetensors, npz), checkpoints of training runs.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <map>
#include <tuple>
#include <utility>

#include "bindings/camera_numbers.h"
#include "bindings/mesh_dict.h"
#include "bindings/to_python.h"
#include "io/camera_file.h"
#include "io/exr_file.h"
#include "io/image_file.h"
#include "io/npz.h"
#include "nn/serialize.h"
#include "train/run/checkpoint.h"

namespace tilegrad::python {
namespace {

constexpr io::NpyType kTypes[] = {io::NpyType::kBool, io::NpyType::kU8,  io::NpyType::kI8,
                                  io::NpyType::kU16,  io::NpyType::kI16, io::NpyType::kU32,
                                  io::NpyType::kI32,  io::NpyType::kU64, io::NpyType::kI64,
                                  io::NpyType::kF32,  io::NpyType::kF64};

py::dtype DTypeOf(io::NpyType type) { return py::dtype(std::string(io::NpyTypeName(type))); }

py::array NpyToPython(io::NpyArray array) {
  const std::vector<py::ssize_t> shape(array.shape.begin(), array.shape.end());
  const auto bytes = static_cast<py::ssize_t>(array.data.size());
  py::array flat = OwnedArray<std::uint8_t>(std::move(array.data), {bytes});
  return flat.attr("view")(DTypeOf(array.type)).attr("reshape")(shape);
}

// A copy of a C-contiguous array. TypeError for a dtype that .npy files of ours do not hold, which
// names `function` and `argument`.
io::NpyArray NpyFromPython(const char* function, const std::string& argument,
                           const py::object& object) {
  const auto array = py::cast<py::array>(object);
  for (const io::NpyType type : kTypes) {
    if (!array.dtype().equal(DTypeOf(type)) || !(array.flags() & py::array::c_style)) continue;
    io::NpyArray out{type, {}, {}};
    out.shape.assign(array.shape(), array.shape() + array.ndim());
    const auto* data = static_cast<const std::uint8_t*>(array.data());
    out.data.assign(data, data + array.nbytes());
    return out;
  }
  throw py::type_error(fmt::format(
      "{}: {} has dtype {}, expected a C-contiguous array of bool, integers, float32 or float64",
      function, argument, py::cast<std::string>(py::str(array.dtype()))));
}

py::array LoadImage(const Path& path, std::size_t max_bytes) {
  ImageU8 image = LoadWithin(max_bytes, [&] { return io::LoadImage(path); });
  return OwnedArray<std::uint8_t>(std::move(image.pixels),
                                  {image.height, image.width, image.channels});
}

// pixels: [height,width,channels] uint8.
void SavePng(const Path& path, const py::object& pixels) {
  const ImageU8 image = ImageFromPython("save_image", "image", pixels);
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

using Metadata = std::map<std::string, std::string>;

constexpr std::pair<nn::DType, io::NpyType> kDTypes[] = {{nn::DType::kF32, io::NpyType::kF32},
                                                         {nn::DType::kF64, io::NpyType::kF64},
                                                         {nn::DType::kU8, io::NpyType::kU8},
                                                         {nn::DType::kI32, io::NpyType::kI32},
                                                         {nn::DType::kI64, io::NpyType::kI64}};

py::array TensorToPython(const nn::Tensor& tensor) {
  io::NpyArray out;
  for (const auto& [dtype, type] : kDTypes) {
    if (dtype == tensor.dtype()) out.type = type;
  }
  for (int axis = 0; axis < tensor.shape().rank(); ++axis)
    out.shape.push_back(static_cast<std::size_t>(tensor.shape()[axis]));
  const auto* data = reinterpret_cast<const std::uint8_t*>(tensor.raw());
  out.data.assign(data, data + tensor.bytes());
  return NpyToPython(std::move(out));
}

nn::Tensor TensorFromPython(const nn::Context& context, const std::string& name,
                            const py::object& array) {
  const io::NpyArray npy = NpyFromPython("save_weights", name, array);
  if (npy.shape.size() > nn::Shape::kMaxRank) {
    throw py::value_error(fmt::format("save_weights: {} has {} axes, at most {} are stored", name,
                                      npy.shape.size(), nn::Shape::kMaxRank));
  }
  nn::Shape shape;
  for (const std::size_t extent : npy.shape) shape.Append(static_cast<std::int64_t>(extent));
  for (const auto& [dtype, type] : kDTypes) {
    if (type != npy.type) continue;
    nn::Tensor out = context.Empty(shape, dtype);
    std::copy(npy.data.begin(), npy.data.end(), reinterpret_cast<std::uint8_t*>(out.raw()));
    return out;
  }
  throw py::type_error(fmt::format(
      "save_weights: {} has dtype {}; supported are float32, float64, uint8, int32 and int64", name,
      io::NpyTypeName(npy.type)));
}

py::dict TensorDict(const std::vector<nn::NamedTensor>& tensors) {
  py::dict out;
  for (const nn::NamedTensor& t : tensors) out[Text(t.name)] = TensorToPython(t.value);
  return out;
}

py::tuple LoadSafetensors(const Path& path, std::size_t max_bytes) {
  const Workers workers(1);
  nn::Context context(workers);
  const nn::TensorFile file =
      LoadWithin(max_bytes, [&] { return nn::ReadSafetensors(context, path); });
  py::dict metadata;
  for (const auto& [key, value] : file.metadata) metadata[Text(key)] = Text(value);
  return py::make_tuple(TensorDict(file.tensors), metadata);
}

void SaveSafetensors(const Path& path, const py::dict& arrays, const Metadata& metadata) {
  const Workers workers(1);
  const nn::Context context(workers);
  nn::TensorFile file;
  for (const auto& [key, array] : arrays) {
    const auto name = py::cast<std::string>(key);
    file.tensors.push_back(
        {name, TensorFromPython(context, name, py::reinterpret_borrow<py::object>(array))});
  }
  file.metadata = metadata;
  ThrowIfError(WithoutGil([&] { return nn::WriteSafetensors(path, file).Within(path.string()); }));
}

py::dict LoadNpz(const Path& path, std::size_t max_bytes) {
  io::NpzArrays arrays = LoadWithin(max_bytes, [&] { return io::LoadNpz(path); });
  py::dict out;
  for (auto& [name, array] : arrays) out[Text(name)] = NpyToPython(std::move(array));
  return out;
}

void SaveNpz(const Path& path, const py::dict& dict) {
  io::NpzArrays arrays;
  for (const auto& [key, array] : dict) {
    const auto name = py::cast<std::string>(key);
    arrays[name] = NpyFromPython("save_weights", name, py::reinterpret_borrow<py::object>(array));
  }
  ThrowIfError(WithoutGil([&] { return io::SaveNpz(path, arrays); }));
}

py::dict LoadCheckpoint(const Path& path) {
  const Workers workers(1);
  nn::Context context(workers);
  const train::FoundCheckpoint found =
      ValueOrThrow(WithoutGil([&] { return train::FindCheckpoint(context, path); }));
  const train::CheckpointInfo& info = found.checkpoint.info;
  return py::dict(py::arg("file") = found.file, py::arg("step") = info.step,
                  py::arg("image_size") = info.image_size, py::arg("config") = Text(info.config),
                  py::arg("seconds") = info.seconds,
                  py::arg("tensors") = TensorDict(found.checkpoint.tensors),
                  py::arg("warnings") = found.warnings);
}

// Files of cameras, and the cameras of glTF files.

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

void BindArrayFiles(py::module_& m) {
  m.def("load_image", &LoadImage, "(H, W, C) uint8.");
  m.def("save_png", &SavePng, "Writes (H, W, C) uint8.");
  m.def("load_exr", &LoadExr,
        "Names of channels, (C, H, W) float32, and warnings about skipped data.");
  m.def("save_exr", &SaveExr, "Writes (C, H, W) float32 with names of channels.");
  m.def("load_npy", &LoadNpy, "The array of an .npy file.");
  m.def("save_npy", &SaveNpy, "Writes an .npy file.");
  m.def("load_safetensors", &LoadSafetensors, "Arrays and metadata by name.");
  m.def("save_safetensors", &SaveSafetensors, "Writes arrays and metadata by name.");
  m.def("load_npz", &LoadNpz, "Arrays by name.");
  m.def("save_npz", &SaveNpz, "Writes arrays by name.");
  m.def("load_checkpoint", &LoadCheckpoint,
        "A checkpoint, or the newest whole one of a run folder.");
}

void BindCameraFiles(py::module_& m) {
  m.def("load_cameras", &LoadCameras,
        "(name, 17 numbers, (width, height)) of each camera of a file or folder.");
  m.def("save_cameras", &SaveCameras,
        "Writes what load_cameras returns, as \"opencv\", \"nerf\" or \"colmap\".");
  m.def("from_gltf", &FromGltf,
        "17 numbers of a glTF camera: 16 numbers row by row, (yfov, aspect ratio, near plane).");
  m.def(
      "rotation_from_vector",
      [](const Vec3Array& rvec) {
        return CopyOf<double>(RotationFromVector(rvec), {3, 3});
      },
      "(3, 3) from OpenCV's rotation vector.");
}

}  // namespace tilegrad::python
