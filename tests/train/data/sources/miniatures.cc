// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/miniatures.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "base/rng.h"
#include "io/binvox.h"
#include "io/image_file.h"
#include "io/npz.h"
#include "render/picture/composite.h"
#include "render/picture/mesh_pictures.h"
#include "render/picture/mesh_scene.h"
#include "support/expect.h"
#include "train/data/dataset.h"
#include "train/data/sources/model_source.h"
#include "train/metrics/metrics.h"

namespace tilegrad::train::miniatures {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr int kViews = 24;
constexpr double kDegree = 3.14159265358979323846 / 180;

void Save(const Path& file, const std::string& text) { Ok(WriteTextAtomic(file, text)); }

// p_cam = rotation (p - eye), `rotation` with the camera's axes (x right, y up, z back) as rows.
Camera CameraOf(const dmat3& rows, dvec3 eye, double focal, int size) {
  Camera camera;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) camera.rotation[3 * r + c] = static_cast<float>(rows[r][c]);
    camera.translation[r] = static_cast<float>(-glm::dot(rows[r], eye));
  }
  camera.fx = camera.fy = static_cast<float>(focal * size);
  camera.cx = camera.cy = 0.5f * static_cast<float>(size);
  return camera;
}

ImageU8 Straight(const Mesh& mesh, const Camera& camera, int size) {
  LitRenderer renderer;
  return Ok(renderer.RenderStraight(mesh, camera, size)).value();
}

// Counter-clockwise about an axis, as columns of GLM.
dmat3 Turn(int axis, double degrees) {
  const double c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
  dmat3 out(1);
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  out[u][u] = out[v][v] = c;
  out[u][v] = s;
  out[v][u] = -s;
  return out;
}

void SaveBinvox(const Path& file, const io::BinvoxGrid& grid) {
  Ok(WriteFileAtomic(file, io::EncodeBinvox(grid)));
}

std::vector<std::uint8_t> Carved(const Mesh& mesh) {
  return Ok(VoxelizeCarved(mesh, kOccupancyResolution)).value();
}

// --- 3D-R2N2: its blender_renderer and render_models ---

struct BlenderView {
  double azimuth, elevation, in_plane, distance;
};

// An empty at the origin is turned by Euler angles x, y, z; its child, the camera, stands at
// (1.75 distance, 0, 0) and looks at it, z up. Blender's import turns y up into z up.
Camera BlenderCamera(const BlenderView& view, int size) {
  const dmat3 empty = Turn(2, -view.azimuth) * Turn(1, -view.elevation) * Turn(0, -view.in_plane);
  const dmat3 camera = empty * dmat3(dvec3(0, 1, 0), dvec3(0, 0, 1), dvec3(1, 0, 0));
  const dvec3 eye = empty * dvec3(1.75 * view.distance, 0, 0);
  const auto to_file = [](dvec3 p) { return dvec3(p.x, p.z, -p.y); };
  return CameraOf({to_file(camera[0]), to_file(camera[1]), to_file(camera[2])}, to_file(eye),
                  35.0 / 32, size);
}

// The grid in the lowest corner of its cube, as without binvox's -cb.
io::BinvoxGrid InTheCorner(io::BinvoxGrid grid) {
  const auto n = static_cast<std::size_t>(grid.side);
  std::array<std::size_t, 3> low = {n, n, n};
  const auto each = [&](const auto& what) {
    for (std::size_t i = 0; i < grid.voxels.size(); ++i) {
      if (grid.voxels[i] != 0) what(std::array{i / n / n, i / n % n, i % n});
    }
  };
  each([&](const std::array<std::size_t, 3>& at) {
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], at[k]);
  });
  std::vector<std::uint8_t> moved(grid.voxels.size());
  each([&](const std::array<std::size_t, 3>& at) {
    moved[((at[0] - low[0]) * n + at[1] - low[1]) * n + at[2] - low[2]] = 1;
  });
  for (std::size_t k = 0; k < 3; ++k)
    grid.translate[k] += grid.scale * static_cast<double>(low[k]) / static_cast<double>(n);
  grid.voxels = std::move(moved);
  return grid;
}

void WriteChoyModel(const Path& folder, const MiniatureModel& model, std::uint64_t number) {
  constexpr int kSize = 137;
  const Path rendering = folder / "ShapeNetRendering" / model.synset / model.id / "rendering";
  // ShapeNet's models are of any size, and not quite around the origin.
  const float scale = 0.6f + 0.05f * static_cast<float>(number % 4);
  const glm::vec3 centre(0.04f, -0.03f, 0.02f);
  Mesh mesh = model.mesh;
  for (glm::vec3& p : mesh.positions) p = scale * p + centre;
  Rng rng(number);
  std::string metadata, names;
  for (int v = 0; v < kViews; ++v) {
    const BlenderView view{360 * rng.Uniform(), 25 + 5 * rng.Uniform(), v == 3 ? 20.0 : 0.0,
                           0.65 + 0.3 * rng.Uniform()};
    metadata +=
        fmt::format("{} {} {} {} 25\n", view.azimuth, view.elevation, view.in_plane, view.distance);
    const std::string name = fmt::format("{:02}.png", v);
    names += name + "\n";
    Ok(io::SavePng(rendering / name, Straight(mesh, BlenderCamera(view, kSize), kSize)));
  }
  Save(rendering / "rendering_metadata.txt", metadata);
  Save(rendering / "renderings.txt", names);
  io::BinvoxGrid grid{kOccupancyResolution, {}, 0.9 * scale, Carved(mesh)};
  for (int k = 0; k < 3; ++k)
    grid.translate[static_cast<std::size_t>(k)] = centre[k] - 0.5 * grid.scale;
  SaveBinvox(folder / "ShapeNetVox32" / model.synset / model.id / "model.binvox",
             number % 3 == 1 ? InTheCorner(grid) : grid);
}

// --- Views around the object: the rows of its axes from where a camera stands ---

dvec3 OrbitEye(double azimuth, double elevation, double distance) {
  const double a = azimuth * kDegree, e = elevation * kDegree;
  return distance * dvec3(std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a));
}

dmat3 LookAtOrigin(dvec3 eye) {  // lookatnp of DIB-R
  const dvec3 forward = glm::normalize(-eye),
              right = glm::normalize(glm::cross(forward, {0, 1, 0}));
  return {right, glm::cross(right, forward), -forward};
}

io::NpyArray Matrix(const dmat3& rows, dvec3 last_column) {
  std::vector<double> numbers;
  for (int r = 0; r < 3; ++r)
    numbers.insert(numbers.end(), {rows[r].x, rows[r].y, rows[r].z, last_column[r]});
  numbers.insert(numbers.end(), {0, 0, 0, 1});
  return io::MakeNpy<double>({4, 4}, numbers);
}

dvec3 Times(const dmat3& rows, dvec3 p) {
  return {glm::dot(rows[0], p), glm::dot(rows[1], p), glm::dot(rows[2], p)};
}

// --- DVR: FAQ.md ---

// Every third model's world is twice as large as its object, and beside it.
void AddDvrCamera(int view, bool scaled, dvec3 eye, const dmat3& gl, io::NpzArrays* out) {
  const dmat3 rows = {gl[0], -gl[1], -gl[2]};  // x right, y down, z forward
  const dvec3 shift = scaled ? dvec3(0.3, -0.2, 0.1) : dvec3(0);
  const double scale = scaled ? 2 : 1, focal = 1 / std::tan(15 * kDegree);
  const std::string number = std::to_string(view);
  (*out)["world_mat_" + number] = Matrix(rows, -Times(rows, scale * eye + shift));
  (*out)["camera_mat_" + number] = Matrix({{focal, 0, 0}, {0, focal, 0}, {0, 0, 1}}, {});
  if (scaled)
    (*out)["scale_mat_" + number] = Matrix({{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}}, shift);
}

void WriteDvrModel(const Path& folder, const MiniatureModel& model, std::uint64_t number) {
  constexpr int kSize = 64;
  io::NpzArrays cameras;
  for (int v = 0; v < kViews; ++v) {
    const dvec3 eye = OrbitEye(15 * v, 30, 2.732);
    const dmat3 rows = LookAtOrigin(eye);
    AddDvrCamera(v, number % 3 == 0, eye, rows, &cameras);
    const ImageU8 rgba =
        Straight(model.mesh, CameraOf(rows, eye, 0.5 / std::tan(15 * kDegree), kSize), kSize);
    ImageU8 image(kSize, kSize, 3, 255), mask(kSize, kSize, 1);
    for (std::size_t p = 0; p < mask.pixels.size(); ++p) {
      mask.pixels[p] = rgba.pixels[4 * p + 3] >= 128 ? 255 : 0;
      if (mask.pixels[p] != 0) std::copy_n(&rgba.pixels[4 * p], 3, &image.pixels[3 * p]);
    }
    const std::string name = fmt::format("{:04}.png", v);
    Ok(io::SavePng(folder / "image" / name, image));
    Ok(io::SavePng(folder / "mask" / name, mask));
  }
  Ok(io::SaveNpz(folder / "cameras.npz", cameras));
  const auto points = Ok(SampleSurface(model.mesh, 100000, number)).value();
  const std::vector<float> loc(3), scale(1, 1.0f);
  Ok(io::SaveNpz(
      folder / "pointcloud.npz",
      {{"points", io::MakeNpy<float>({points.size(), 3}, {&points[0].x, 3 * points.size()})},
       {"loc", io::MakeNpy<float>({3}, loc)},
       {"scale", io::MakeNpy<float>({}, scale)}}));
}

// --- DIB-R ---

std::string ObjOf(const Mesh& mesh) {
  std::string out;
  for (const glm::vec3& p : mesh.positions) out += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  for (const Face& f : mesh.faces) out += fmt::format("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1);
  return out;
}

void WriteDibrModel(const Path& folder, const MiniatureModel& model) {
  constexpr int kSize = 64;
  for (int v = 0; v < kViews; ++v) {
    const dvec3 eye = OrbitEye(-15 * v, 27, 1.45);
    const dmat3 rows = LookAtOrigin(eye);
    const Bytes matrix = io::EncodeNpy(Matrix(rows, -Times(rows, eye)));
    Ok(WriteFileAtomic(folder / fmt::format("{}.npy", v), matrix));
    Ok(io::SavePng(folder / fmt::format("{}.png", v),
                   Straight(model.mesh, CameraOf(rows, eye, 35.0 / 32, kSize), kSize)));
  }
  Save(folder / "model-0.45.obj", ObjOf(model.mesh));
  SaveBinvox(folder / "model-0.45.binvox",
             {kOccupancyResolution, {-0.45, -0.45, -0.45}, 0.9, Carved(model.mesh)});
}

}  // namespace

std::vector<MiniatureModel> MiniatureModels(float half_extent) {
  std::vector<MiniatureModel> models;
  for (int c = 0; c < 2; ++c) {
    for (int i = 0; i < kMiniatureModels; ++i) {
      const auto number = static_cast<std::uint64_t>(i);
      Mesh mesh = ProceduralModel(c, number, 3);
      Ok(NormalizeToBox(mesh, half_extent));
      models.push_back(
          {kMiniatureSynsets[c], fmt::format("{:032x}", 100 * c + i), std::move(mesh)});
    }
  }
  return models;
}

void WriteChoy(const Path& folder, const std::vector<MiniatureModel>& models) {
  for (std::size_t i = 0; i < models.size(); ++i) WriteChoyModel(folder, models[i], i);
}

// The last of a class tests, the one before validates.
void WriteDvr(const Path& folder, const std::vector<MiniatureModel>& models) {
  std::map<std::string, std::string> lists;
  for (std::size_t i = 0; i < models.size(); ++i) {
    WriteDvrModel(folder / models[i].synset / models[i].id, models[i], i);
    const int number = static_cast<int>(i) % kMiniatureModels;
    const char* split = number < kMiniatureModels - 2    ? "train"
                        : number == kMiniatureModels - 2 ? "val"
                                                         : "test";
    lists[models[i].synset + "/softras_" + split + ".lst"] += models[i].id + "\n";
  }
  for (const auto& [name, text] : lists) Save(folder / name, text);
}

void WriteDibr(const Path& folder, const std::vector<MiniatureModel>& models) {
  for (const MiniatureModel& model : models)
    WriteDibrModel(folder / model.synset / model.id, model);
}

// N3MR's cameras in our frame: sources_test.cc projects through both.
void WriteNmr(const Path& folder, const std::vector<MiniatureModel>& models) {
  constexpr int kSize = 64;
  constexpr std::size_t kSide = kOccupancyResolution;
  struct Part {
    std::vector<std::uint8_t> images, voxels;
    std::size_t models = 0;
  };
  std::map<std::string, Part> parts;
  LitRenderer renderer;
  std::vector<Camera> cameras;
  for (int v = 0; v < kViews; ++v) {
    const dvec3 eye = OrbitEye(15 * v, 30, 2.732);
    cameras.push_back(CameraOf(LookAtOrigin(eye), eye, 0.5 / std::tan(15 * kDegree), kSize));
  }
  for (std::size_t i = 0; i < models.size(); ++i) {
    const bool tests = i % kMiniatureModels == kMiniatureModels - 1;
    Part& part = parts[models[i].synset + (tests ? "_test" : "_train")];
    const auto images = Ok(renderer.Render(models[i].mesh, cameras, kSize)).value();
    part.images.insert(part.images.end(), images.begin(), images.end());
    const auto ours = Ok(VoxelizeNmr(models[i].mesh, 0.5, kOccupancyResolution)).value();
    for (std::size_t y = 0; y < kSide; ++y) {
      for (std::size_t z = kSide; z-- > 0;) {
        for (std::size_t x = 0; x < kSide; ++x)
          part.voxels.push_back(ours[(x * kSide + y) * kSide + z]);
      }
    }
    ++part.models;
  }
  for (const auto& [name, part] : parts) {
    auto voxels = io::MakeNpy<std::uint8_t>({part.models, kSide, kSide, kSide}, part.voxels);
    voxels.type = io::NpyType::kBool;
    Ok(io::SaveNpz(folder / (name + "_voxels.npz"), {{"arr_0", voxels}}));
    Ok(io::SaveNpz(
        folder / (name + "_images.npz"),
        {{"arr_0", io::MakeNpy<std::uint8_t>({part.models, 24, 4, 64, 64}, part.images)}}));
  }
}

}  // namespace tilegrad::train::miniatures
