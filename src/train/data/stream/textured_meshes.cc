// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/textured_meshes.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <tuple>

#include "base/error.h"
#include "base/free_memory.h"
#include "base/read_budget.h"
#include "scene/shrink_image.h"
#include "scene/topology.h"
#include "train/data/build/make_model.h"
#include "train/data/build/truth_mesh.h"
#include "train/data/sources/installed.h"
#include "train/data/sources/split_list.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

// They would count when a deformed copy is scaled to its box.
void CentreUnusedVertices(Mesh* mesh) {
  std::vector<bool> used(mesh->positions.size());
  for (const Face& face : mesh->faces) {
    for (const std::int32_t v : face) used[static_cast<std::size_t>(v)] = true;
  }
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (!used[v]) mesh->positions[v] = glm::vec3(0);
  }
}

Result<std::unique_ptr<ModelSource>> OpenSource(const DatasetInfo& info, const std::string& given) {
  const std::string& folder = given.empty() ? info.input : given;
  if (info.source == "shapenet" && !folder.empty()) return ShapeNetSource(folder, {});
  if (!folder.empty()) return FolderSource(folder);
  const bool installed =
      info.source == kThirteen || FindInstalledSource(info.source.substr(0, info.source.find('+')));
  if (installed) return OpenInstalledSources(info.source);
  return std::unique_ptr<ModelSource>();
}

class Loader {
 public:
  Loader(const Dataset& dataset, const TexturedMeshRequest& request, std::vector<int> models)
      : dataset_(dataset),
        request_(request),
        models_(std::move(models)),
        entries_(models_.size(), kNone) {}

  Status Open() {
    if (request_.colored) return {};
    TILEGRAD_ASSIGN(source_, OpenSource(dataset_.info(), request_.folder));
    if (!source_) return {};
    for (std::size_t i = 0; i < models_.size(); ++i) {
      entries_[i] = EntryOf(models_[i]);
      if (entries_[i] == kNone) return Changed(models_[i], "no longer exists");
    }
    source_->ForgetEntries();
    return {};
  }

  // Which of the models is loaded as the n-th: sources want their entries in ascending order.
  std::vector<std::size_t> Order() const {
    std::vector<std::size_t> order(entries_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return entries_[a] < entries_[b]; });
    return order;
  }

  Result<TexturedMesh> Load(std::size_t i) const {
    TILEGRAD_ASSIGN(Mesh mesh, entries_[i] == kNone ? FromDataset(models_[i])
                                                    : FromSource(models_[i], entries_[i]));
    const auto most = static_cast<std::size_t>(request_.max_faces);
    if (request_.colored) {
      mesh = MakeTruthMesh(mesh, most);
    } else {
      if (most > 0) ClusterFaces(most, &mesh);
      CentreUnusedVertices(&mesh);
    }
    if (request_.crease <= 0) return TexturedMesh(std::move(mesh));
    SplitAtCreases(request_.crease, &mesh);
    return TexturedMesh(std::move(mesh), NormalSource::kSmooth);
  }

 private:
  const ModelInfo& InfoOf(int model) const { return dataset_.model(model); }
  const std::string& ClassOf(int model) const { return dataset_.ClassOf(InfoOf(model)); }
  // Of the source's, which are sorted.
  std::size_t EntryOf(int model) const {
    const auto& all = source_->entries();
    const auto wanted = std::tie(ClassOf(model), InfoOf(model).id);
    const auto at = std::lower_bound(
        all.begin(), all.end(), wanted,
        [](const SourceEntry& e, const auto& key) { return std::tie(e.class_name, e.id) < key; });
    const bool found = at != all.end() && std::tie(at->class_name, at->id) == wanted;
    return found ? static_cast<std::size_t>(at - all.begin()) : kNone;
  }
  Status Changed(int model, const char* how) const {
    return InvalidArgument(
        "{}: the model {}/{} of {} {} there; rebuild the dataset from the current files",
        dataset_.folder().string(), ClassOf(model), InfoOf(model).id, source_->facts().name, how);
  }

  Result<Mesh> FromDataset(int model) const {
    TILEGRAD_ASSIGN(ModelData data, dataset_.Load(model));
    if (!data.mesh.faces.empty()) return std::move(data.mesh);
    return InvalidArgument("{}: has no mesh to render{}", dataset_.ModelPath(model).string(),
                           request_.colored ? "; set stream.share to 0" : "");
  }

  // The dataset does not note which axis was up; its shape tells.
  Result<Mesh> FromSource(int model, std::size_t entry) const {
    TILEGRAD_ASSIGN(SourceModel loaded, source_->Load(entry));
    auto* given = std::get_if<Mesh>(&loaded.data);
    if (given == nullptr) return Changed(model, "has no mesh");
    for (MeshTexture& texture : given->textures)
      texture.image = ShrunkImage(texture.image, request_.max_texture);
    DatasetInfo info = dataset_.info();
    for (const UpAxis up : {UpAxis::kY, UpAxis::kZ, UpAxis::kX}) {
      Mesh mesh = *given;
      info.up = up;
      TILEGRAD_TRY(PrepareMesh(info, &mesh));
      if (GeometryFingerprint(mesh) == InfoOf(model).geometry) return mesh;
    }
    return Changed(model, "has another shape");
  }

  const Dataset& dataset_;
  const TexturedMeshRequest request_;
  const std::vector<int> models_;
  std::unique_ptr<ModelSource> source_;  // null: the dataset's own meshes
  std::vector<std::size_t> entries_;     // of models_
};

}  // namespace

Result<MeshCache> OpenTexturedMeshes(const Dataset& dataset, const std::vector<int>& models,
                                     const TexturedMeshRequest& request, const Workers& workers,
                                     const Watch& watch) {
  const auto bytes = ParseByteCount(request.cache);
  if (!bytes.ok()) return bytes.status().Within("stream.cache");
  const auto loader = std::make_shared<Loader>(dataset, request, models);
  TILEGRAD_TRY(loader->Open());
  MeshCache meshes(models.size(), *bytes, [loader](std::size_t i) { return loader->Load(i); });
  const std::vector<std::size_t> order = loader->Order();
  std::vector<Status> failures(models.size());
  std::mutex mutex;
  std::atomic<std::size_t> next = 0;
  std::size_t done = 0;
  workers.For(static_cast<std::size_t>(workers.count()), [&](std::size_t, std::size_t) {
    for (std::size_t n = next++; n < order.size() && !watch.stopped() && !meshes.full();
         n = next++) {
      failures[order[n]] = meshes.Get(order[n]).status();
      const std::scoped_lock lock(mutex);
      watch.Report({"loading meshes", ++done, order.size(),
                    fmt::format("{:.1f} MB", static_cast<double>(meshes.bytes()) / 1e6)});
    }
  });
  if (watch.stopped()) return Cancelled("stopped while loading meshes");
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  ReturnFreeMemory();  // of lists of all files
  return meshes;
}

}  // namespace tilegrad::train
