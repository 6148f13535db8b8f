// SPDX-License-Identifier: Apache-2.0
// The textured meshes behind a dataset, in memory. A dataset keeps coloured meshes only, so they
// are read again from where it was made from.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "render/picture/mesh_scene.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

// A mesh as the dataset shows it, with small textures, ready to be rendered: two-sided, opaque, in
// the numbers of the files.
class TexturedMesh {
 public:
  explicit TexturedMesh(Mesh mesh, NormalSource normals = NormalSource::kFlat);
  const Mesh& mesh() const { return *mesh_; }
  const Scene& scene() const { return scene_->scene(); }
  std::size_t bytes() const;

 private:
  std::unique_ptr<Mesh> mesh_;
  std::unique_ptr<MeshScene> scene_;  // refers to it
};

struct TexturedMeshRequest {
  // A folder of models as `tilegrad dataset --source folder --input` takes it. Empty: the installed
  // packages that the dataset was made from (sources/installed.h); of any other source the coloured
  // meshes of the dataset itself.
  std::string folder = {};
  int max_texture = 128;  // texels a side; larger textures are averaged down
  // More than 0: the coloured meshes of the dataset, clustered to at most so many faces.
  std::int64_t max_faces = 0;
  // Degrees: normals are smooth across edges where faces meet at less (scene/creases.h), as
  // renderers of models shade them; 0: flat.
  double crease = 0;
};

// Of these models, in their order. Errors: a model that cannot be read, that is not there any more,
// or whose shape is another than when the dataset was made. kCancelled when `stop` is set.
Result<std::vector<TexturedMesh>> LoadTexturedMeshes(
    const Dataset& dataset, const std::vector<int>& models, const TexturedMeshRequest& request,
    const Workers& workers, const ProgressSink& progress, const StopFlag& stop);

// The mean of the pixels behind each of an image that has at most `side` pixels a side; the same
// image if it has them already.
ImageU8 ShrunkImage(const ImageU8& image, int side);

}  // namespace tilegrad::train
