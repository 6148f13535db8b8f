// SPDX-License-Identifier: Apache-2.0
// A dataset on disk: rendered views of 3D models, split by model, and what evaluation needs.
//
//   <folder>/dataset.json              DatasetInfo: how it was made, camera rule, classes, credits
//   <folder>/models.jsonl              one ModelInfo a line, in a fixed order; appears when all is
//                                      complete
//   <folder>/rejected.jsonl            models that could not be used: id, class, file, reason
//   <folder>/models/<class>/<id>.npz   ModelData: images, occupancy, points, mesh
//   <folder>/contact_sheet.png         to look at
//   <folder>/pictures.bin              for large sets, written by training (picture_pack.h)
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/camera.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::train {

// The same for every model: view i is OrbitCamera(lens, azimuth_step * i, elevation, distance). The
// defaults are those of the paper's own renders.
struct CameraRule {
  Lens lens;                    // width = height = the image size
  double azimuth_step = -15.0;  // degrees
  double elevation = 27.0;      // degrees
  double distance = 1.45;       // world units; the object's largest half-extent is `half_extent`
  double half_extent = 0.45;
  Camera View(int index) const;
};

struct DatasetInfo {
  std::string source;   // "sweethome3d", "shapenet", "planes", "folder", ...
  int image_size = 64;  // pixels, square
  int views = 24;       // per model
  CameraRule camera;
  std::vector<std::string> classes;  // sorted; ModelInfo::class_index points here
  std::vector<std::string> credits;  // one sentence a source
  std::string input;                 // absolute folder of the models, of "shapenet"; else empty
  std::string recipe;                // 16 hex digits, a hash of all that determines the model files
  UpAxis up = UpAxis::kY;            // of the source's meshes; used only while building
  bool own_cameras = false;          // each model has its own cameras, similar to `camera`
};

// `count` of `views`, evenly spread: 0, step, 2 step, ...
std::vector<int> SpreadViews(int views, int count);

enum class Split { kTrain, kValidation, kTest };

struct ModelInfo {
  std::string id;    // unique in its class, safe as a file name
  std::string name;  // for people
  int class_index = 0;
  Split split = Split::kTrain;
  std::string license, creator;  // empty where unknown
  int source_faces = 0;          // triangles of the source's mesh
  std::uint64_t geometry = 0;    // equal for copies of one mesh in other colours; 0: no mesh
  std::string shape = {};        // the same for one shape with other textures; empty: its own
};

// The unit in which models are counted: the shape that a model shares, else itself. Unique in its
// class.
inline const std::string& ShapeOf(const ModelInfo& model) {
  return model.shape.empty() ? model.id : model.shape;
}

// Counts each shape of a class once.
std::size_t CountShapes(const std::vector<ModelInfo>& models);

// A network only memorises fewer training shapes than this; streaming (data/stream) makes variants
// of each, so that fewer suffice.
inline constexpr std::size_t kFewShapes = 50, kFewStreamedShapes = 20;
// Advice for the user, if the training models among these are too few.
std::optional<std::string> AdviceOnFewModels(const std::vector<ModelInfo>& models, bool streamed);

inline constexpr int kOccupancyResolution = 32;  // voxels a side
inline constexpr int kTruthPoints = 2500;        // as in the official code, for the F-score
inline constexpr int kTruthFaces = 5000;

struct ModelData {
  // [views][4][size][size], planar RGBA, row 0 on top; RGB over black (premultiplied).
  std::vector<std::uint8_t> images;
  // By view; empty unless DatasetInfo::own_cameras (CamerasOf).
  std::vector<Camera> cameras = {};
  // [32][32][32] as [x][y][z], 0 or 1: solid occupancy of the mesh scaled to fill the cube
  // (by which rule: train/metrics/metrics.h).
  std::vector<std::uint8_t> occupancy;
  // kTruthPoints area-weighted samples of the surface; largest half-extent 0.45. Empty where the
  // source has no meshes ("nmr").
  std::vector<glm::vec3> points;
  // Normalised truth for reports: positions, faces and per-vertex colours; at most kTruthFaces
  // faces. Empty where the source has no meshes.
  Mesh mesh;
};

// One or some views in ModelData::images, the latter one after the other.
std::span<const std::uint8_t> ViewOf(const DatasetInfo& info, std::span<const std::uint8_t> images,
                                     int view);
std::vector<std::uint8_t> ViewsOf(const DatasetInfo& info, std::span<const std::uint8_t> images,
                                  std::span<const int> views);

// The cameras of a model's views: `own` or, if that is empty, those of all models.
std::vector<Camera> CamerasOf(const DatasetInfo& info, const std::vector<Camera>& own);

class Dataset {
 public:
  // Reads the two index files; errors name the file and the line or key. Model files are read by
  // Load. An unfinished dataset has no models.jsonl yet, and the error says so.
  static Result<Dataset> Open(const Path& folder);

  const Path& folder() const { return folder_; }
  const DatasetInfo& info() const { return info_; }
  const std::vector<ModelInfo>& models() const { return models_; }
  const ModelInfo& model(int index) const { return models_[static_cast<std::size_t>(index)]; }
  const std::string& ClassOf(const ModelInfo& model) const {  // its name
    return info_.classes[static_cast<std::size_t>(model.class_index)];
  }
  std::vector<int> Select(Split split) const;  // indices into models(), ascending

  // Errors name the file and the array: missing, of another shape than dataset.json promises, not
  // finite.
  Result<ModelData> Load(int model) const;                        // everything
  Result<std::vector<std::uint8_t>> LoadImages(int model) const;  // ModelData::images only
  Result<std::vector<Camera>> LoadCameras(int model) const;       // of its views
  Path ModelPath(int model) const;

 private:
  Path folder_;
  DatasetInfo info_;
  std::vector<ModelInfo> models_;
};

}  // namespace tilegrad::train
