// SPDX-License-Identifier: Apache-2.0
// The npz file of one model.
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/npz.h"
#include "scene/camera_conventions.h"
#include "train/data/dataset_files.h"

namespace tilegrad::train {
namespace {

using io::MakeNpy;
using io::NpyArray;
using io::NpzArrays;
using ArrayShape = std::vector<std::size_t>;

constexpr std::size_t kAny = static_cast<std::size_t>(-1);  // in an expected shape: any length

template <class Vector>
NpyArray VectorsToNpy(const std::vector<Vector>& values) {
  const std::size_t width = sizeof(Vector) / sizeof(float);
  const auto* first = reinterpret_cast<const float*>(values.data());
  return MakeNpy<float>({values.size(), width}, {first, values.size() * width});
}

bool Matches(const ArrayShape& shape, const ArrayShape& wanted) {
  return std::equal(shape.begin(), shape.end(), wanted.begin(), wanted.end(),
                    [](std::size_t a, std::size_t b) { return b == kAny || a == b; });
}

template <class T>
Result<std::vector<T>> Take(const NpyArray& array, const std::string& name,
                            const ArrayShape& wanted) {
  if (!Matches(array.shape, wanted))
    return DataLoss("array \"{}\" does not have the shape that dataset.json declares", name);
  auto values = array.As<T>();
  if (!values.ok()) return values.status().Within(fmt::format("array \"{}\"", name));
  return values;
}

template <class T>
Result<std::vector<T>> Take(const NpzArrays& arrays, const std::string& name,
                            const ArrayShape& wanted) {
  const auto at = arrays.find(name);
  if (at == arrays.end()) return DataLoss("array \"{}\" is missing", name);
  return Take<T>(at->second, name, wanted);
}

template <class Vector>
Status TakeVectors(const NpzArrays& arrays, const std::string& name, std::vector<Vector>* out) {
  const std::size_t width = sizeof(Vector) / sizeof(float);
  TILEGRAD_ASSIGN(const std::vector<float> values, Take<float>(arrays, name, {kAny, width}));
  if (!std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }))
    return DataLoss("array \"{}\" holds a number that is not finite", name);
  out->resize(values.size() / width);
  std::copy(values.begin(), values.end(), reinterpret_cast<float*>(out->data()));
  return {};
}

Status TakeFaces(const NpzArrays& arrays, std::vector<Face>* out) {
  TILEGRAD_ASSIGN(const auto values, Take<std::int32_t>(arrays, "mesh_faces", {kAny, 3}));
  for (std::size_t i = 0; i < values.size(); i += 3)
    out->push_back({values[i], values[i + 1], values[i + 2]});
  return {};
}

Status TakeOccupancy(const NpzArrays& arrays, std::vector<std::uint8_t>* out) {
  const std::size_t n = kOccupancyResolution;
  TILEGRAD_ASSIGN(*out, Take<std::uint8_t>(arrays, "occupancy", {n, n, n}));
  if (std::any_of(out->begin(), out->end(), [](std::uint8_t v) { return v > 1; }))
    return DataLoss("array \"occupancy\" holds a value other than 0 and 1");
  return {};
}

// Of a camera in a file: rotation, translation, fx, fy, cx, cy.
constexpr std::size_t kModelCameraNumbers = 16;

ArrayShape CameraShape(const DatasetInfo& info) {
  return {static_cast<std::size_t>(info.views), kModelCameraNumbers};
}

NpyArray CamerasToNpy(const DatasetInfo& info, const std::vector<Camera>& cameras) {
  std::vector<float> numbers;
  for (const Camera& c : cameras) {
    numbers.insert(numbers.end(), std::begin(c.rotation), std::end(c.rotation));
    numbers.insert(numbers.end(), std::begin(c.translation), std::end(c.translation));
    numbers.insert(numbers.end(), {c.fx, c.fy, c.cx, c.cy});
  }
  return MakeNpy<float>(CameraShape(info), numbers);
}

Result<std::vector<Camera>> CamerasFromNpy(const NpyArray& array, const DatasetInfo& info) {
  TILEGRAD_ASSIGN(const auto numbers, Take<float>(array, "cameras", CameraShape(info)));
  std::vector<Camera> cameras(static_cast<std::size_t>(info.views));
  const float* at = numbers.data();
  for (Camera& c : cameras) {
    std::copy_n(at, 9, c.rotation);
    std::copy_n(at + 9, 3, c.translation);
    c.fx = at[12];
    c.fy = at[13];
    c.cx = at[14];
    c.cy = at[15];
    at += kModelCameraNumbers;
    TILEGRAD_TRY(Validate(CameraCast<double>(c)).Within("array \"cameras\""));
  }
  return cameras;
}

ArrayShape ImageShape(const DatasetInfo& info) {
  const auto size = static_cast<std::size_t>(info.image_size);
  return {static_cast<std::size_t>(info.views), 4, size, size};
}

Result<ModelData> FromArrays(const NpzArrays& arrays, const DatasetInfo& info) {
  ModelData data;
  TILEGRAD_ASSIGN(data.images, Take<std::uint8_t>(arrays, "images", ImageShape(info)));
  if (info.own_cameras) {
    const auto at = arrays.find("cameras");
    if (at == arrays.end()) return DataLoss("array \"cameras\" is missing");
    TILEGRAD_ASSIGN(data.cameras, CamerasFromNpy(at->second, info));
  }
  TILEGRAD_TRY(TakeOccupancy(arrays, &data.occupancy));
  TILEGRAD_TRY(TakeVectors(arrays, "points", &data.points));
  TILEGRAD_TRY(TakeVectors(arrays, "mesh_positions", &data.mesh.positions));
  TILEGRAD_TRY(TakeVectors(arrays, "mesh_colors", &data.mesh.colors));
  TILEGRAD_TRY(TakeFaces(arrays, &data.mesh.faces));
  TILEGRAD_TRY(Validate(data.mesh));
  return data;
}

NpyArray TextToNpy(const std::string& text) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  return MakeNpy<std::uint8_t>({text.size()}, {bytes, text.size()});
}

Result<ModelStamp> StampFromArrays(const NpzArrays& arrays) {
  ModelStamp stamp;
  TILEGRAD_ASSIGN(const auto recipe, Take<std::uint8_t>(arrays, "recipe", {kAny}));
  TILEGRAD_ASSIGN(const auto numbers, Take<std::int64_t>(arrays, "stamp", {2}));
  stamp.recipe.assign(recipe.begin(), recipe.end());
  stamp.geometry = static_cast<std::uint64_t>(numbers[0]);
  stamp.source_faces = static_cast<int>(numbers[1]);
  if (arrays.contains("inputs")) {
    TILEGRAD_ASSIGN(const auto inputs, Take<std::uint8_t>(arrays, "inputs", {kAny}));
    stamp.inputs.assign(inputs.begin(), inputs.end());
  }
  return stamp;
}

}  // namespace

Status SaveModelFile(const Path& path, const DatasetInfo& info, const ModelData& data,
                     const ModelStamp& stamp) {
  const std::size_t n = kOccupancyResolution;
  const auto* faces = reinterpret_cast<const std::int32_t*>(data.mesh.faces.data());
  const std::size_t face_count = data.mesh.faces.size();
  const std::int64_t numbers[] = {static_cast<std::int64_t>(stamp.geometry), stamp.source_faces};
  NpzArrays arrays = {
      {"images", MakeNpy<std::uint8_t>(ImageShape(info), data.images)},
      {"occupancy", MakeNpy<std::uint8_t>({n, n, n}, data.occupancy)},
      {"points", VectorsToNpy(data.points)},
      {"mesh_positions", VectorsToNpy(data.mesh.positions)},
      {"mesh_colors", VectorsToNpy(data.mesh.colors)},
      {"mesh_faces", MakeNpy<std::int32_t>({face_count, 3}, {faces, 3 * face_count})},
      {"recipe", TextToNpy(stamp.recipe)},
      {"stamp", MakeNpy<std::int64_t>({2}, numbers)},
  };
  if (info.own_cameras) arrays["cameras"] = CamerasToNpy(info, data.cameras);
  if (!stamp.inputs.empty()) arrays["inputs"] = TextToNpy(stamp.inputs);
  return io::SaveNpz(path, arrays);
}

Result<ModelData> LoadModelFile(const Path& path, const DatasetInfo& info) {
  TILEGRAD_ASSIGN(const NpzArrays arrays, io::LoadNpz(path));
  auto data = FromArrays(arrays, info);
  if (!data.ok()) return data.status().Within(path.string());
  return data;
}

Result<std::vector<std::uint8_t>> LoadModelImages(const Path& path, const DatasetInfo& info) {
  TILEGRAD_ASSIGN(const NpyArray array, io::LoadNpzArray(path, "images"));
  auto images = Take<std::uint8_t>(array, "images", ImageShape(info));
  if (!images.ok()) return images.status().Within(path.string());
  return images;
}

Result<std::vector<Camera>> LoadModelCameras(const Path& path, const DatasetInfo& info) {
  TILEGRAD_ASSIGN(const NpyArray array, io::LoadNpzArray(path, "cameras"));
  auto cameras = CamerasFromNpy(array, info);
  if (!cameras.ok()) return cameras.status().Within(path.string());
  return cameras;
}

Result<ModelStamp> VerifyModelFile(const Path& path, const DatasetInfo& info) {
  TILEGRAD_ASSIGN(const NpzArrays arrays, io::LoadNpz(path));
  if (auto data = FromArrays(arrays, info); !data.ok()) return data.status().Within(path.string());
  TILEGRAD_ASSIGN(const ModelStamp stamp, StampFromArrays(arrays));
  if (stamp.recipe != info.recipe)
    return DataLoss("{}: was made with another recipe", path.string());
  return stamp;
}

}  // namespace tilegrad::train
