// SPDX-License-Identifier: Apache-2.0
// The textured meshes behind a dataset, which itself keeps coloured ones only: read from its
// source.
#pragma once

#include <string>
#include <vector>

#include "base/parallel.h"
#include "base/progress.h"
#include "train/data/dataset.h"
#include "train/data/stream/mesh_cache.h"

namespace tilegrad::train {

struct TexturedMeshRequest {
  // A folder of models as `tilegrad dataset --input` takes it, for --source shapenet if the dataset
  // is of that, else for --source folder. Empty: the folder that the dataset notes, or the
  // installed packages that it was made from (sources/installed.h); of any other source the
  // coloured meshes of the dataset itself.
  std::string folder = {};
  int max_texture = 128;       // texels a side; larger textures are averaged down
  std::int64_t max_faces = 0;  // larger meshes are clustered (build/truth_mesh.h); 0: none
  bool colored = false;        // the coloured meshes of the dataset itself, of any source
  // Degrees: normals are smooth across edges where faces meet at less (scene/topology.h), as
  // renderers of models shade them; 0: flat.
  double crease = 0;
  std::string cache = "4G";  // of memory, as ParseByteCount reads it
};

// Of these models, in their order; `dataset` outlives them. Reads as many at once as the cache has
// room for; the others report their errors when they are read: a model that is unreadable, missing,
// or of another shape than when the dataset was made. kCancelled when `stop` is set.
Result<MeshCache> OpenTexturedMeshes(const Dataset& dataset, const std::vector<int>& models,
                                     const TexturedMeshRequest& request, const Workers& workers,
                                     const Watch& watch);

}  // namespace tilegrad::train
