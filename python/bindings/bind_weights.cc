// SPDX-License-Identifier: Apache-2.0
// Weights of networks (safetensors, npz) and checkpoints of training runs.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <map>

#include "bindings/npy_arrays.h"
#include "bindings/to_python.h"
#include "nn/serialize.h"
#include "train/run/checkpoint.h"

namespace tilegrad::python {

void BindWeights(py::module_& m);

namespace {

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
      "save_weights: {} has dtype {}; safetensors files of ours hold float32, float64, uint8, "
      "int32 and int64",
      name, io::NpyTypeName(npy.type)));
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

}  // namespace

void BindWeights(py::module_& m) {
  m.def("load_safetensors", &LoadSafetensors, py::arg("path"), py::arg("max_bytes") = 0,
        "Arrays and metadata by name.");
  m.def("save_safetensors", &SaveSafetensors, py::arg("path"), py::arg("arrays"),
        py::arg("metadata"), "Writes arrays and metadata by name.");
  m.def("load_npz", &LoadNpz, py::arg("path"), py::arg("max_bytes") = 0, "Arrays by name.");
  m.def("save_npz", &SaveNpz, py::arg("path"), py::arg("arrays"), "Writes arrays by name.");
  m.def("load_checkpoint", &LoadCheckpoint, py::arg("path"),
        "A checkpoint, or the newest whole one of a run folder.");
}

}  // namespace tilegrad::python
