// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/textured_meshes.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <mutex>

#include "base/error.h"
#include "base/read_budget.h"
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

// The first of the pixels behind each of `to` ones along an axis of `from`; last, `from`.
std::vector<int> Blocks(int from, int to) {
  std::vector<int> first;
  for (int i = 0; i <= to; ++i)
    first.push_back(static_cast<int>(static_cast<std::int64_t>(i) * from / to));
  return first;
}

struct PixelBlock {
  int left, right, top, bottom;
};

void MeanOfBlock(const ImageU8& image, const PixelBlock& block, std::uint8_t* out) {
  std::array<std::uint64_t, 4> sum = {};
  const auto channels = static_cast<std::size_t>(image.channels);
  for (int v = block.top; v < block.bottom; ++v) {
    const std::uint8_t* at = image.at(block.left, v);
    for (int u = block.left; u < block.right; ++u, at += channels) {
      for (std::size_t c = 0; c < channels; ++c) sum[c] += at[c];
    }
  }
  const auto count = static_cast<std::uint64_t>(block.bottom - block.top) *
                     static_cast<std::uint64_t>(block.right - block.left);
  for (std::size_t c = 0; c < channels; ++c)
    out[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
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
    std::map<std::pair<std::string, std::string>, std::size_t> places;
    for (std::size_t e = 0; e < source_->entries().size(); ++e)
      places[{source_->entries()[e].class_name, source_->entries()[e].id}] = e;
    for (std::size_t i = 0; i < models_.size(); ++i) {
      const auto at = places.find({ClassOf(models_[i]), InfoOf(models_[i]).id});
      if (at == places.end()) return Changed(models_[i], "no longer exists");
      entries_[i] = at->second;
    }
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
    for (MeshTexture& texture : mesh.textures)
      texture.image = ShrunkImage(texture.image, request_.max_texture);
    if (request_.crease <= 0) return TexturedMesh(std::move(mesh));
    SplitAtCreases(request_.crease, &mesh);
    return TexturedMesh(std::move(mesh), NormalSource::kSmooth);
  }

 private:
  const ModelInfo& InfoOf(int model) const {
    return dataset_.models()[static_cast<std::size_t>(model)];
  }
  const std::string& ClassOf(int model) const {
    return dataset_.info().classes[static_cast<std::size_t>(InfoOf(model).class_index)];
  }
  Status Changed(int model, const char* how) const {
    return InvalidArgument(
        "{}: the model {}/{} of {} {} there; rebuild the dataset from the current files",
        dataset_.folder().string(), ClassOf(model), InfoOf(model).id, source_->name(), how);
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
    const auto* given = std::get_if<Mesh>(&loaded.data);
    if (given == nullptr) return Changed(model, "has no mesh");
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
                                     const ProgressSink& progress, const StopFlag& stop) {
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
    for (std::size_t n = next++; n < order.size() && !stop && !meshes.full(); n = next++) {
      failures[order[n]] = meshes.Get(order[n]).status();
      const std::scoped_lock lock(mutex);
      if (progress)
        progress({"loading meshes", ++done, order.size(),
                  fmt::format("{:.1f} MB", static_cast<double>(meshes.bytes()) / 1e6)});
    }
  });
  if (stop) return Cancelled("stopped while loading meshes");
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  return meshes;
}

ImageU8 ShrunkImage(const ImageU8& image, int side) {
  const int longest = std::max(image.width, image.height);
  if (longest <= side) return image;
  const auto shorter = [&](int n) {
    return std::max(1, static_cast<int>(static_cast<std::int64_t>(n) * side / longest));
  };
  ImageU8 out(shorter(image.width), shorter(image.height), image.channels);
  const std::vector<int> rows = Blocks(image.height, out.height),
                         columns = Blocks(image.width, out.width);
  for (int y = 0; y < out.height; ++y) {
    const auto row = static_cast<std::size_t>(y);
    for (int x = 0; x < out.width; ++x) {
      const auto column = static_cast<std::size_t>(x);
      const PixelBlock block{columns[column], columns[column + 1], rows[row], rows[row + 1]};
      MeanOfBlock(image, block, out.at(x, y));
    }
  }
  return out;
}

}  // namespace tilegrad::train
