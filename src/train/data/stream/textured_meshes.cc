// SPDX-License-Identifier: Apache-2.0
#include "train/data/stream/textured_meshes.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>

#include "base/error.h"
#include "scene/creases.h"
#include "train/data/build/make_model.h"
#include "train/data/build/truth_mesh.h"
#include "train/data/sources/installed.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

MeshSceneOptions SceneOptions(NormalSource normals) {
  MeshSceneOptions options;
  options.color_space = ColorSpace::kSrgb;
  options.normals = normals;
  options.filter = Filter::kBilinear;
  options.blend = false;
  return options;
}

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

Result<std::unique_ptr<ModelSource>> OpenSource(const Dataset& dataset, const std::string& folder) {
  if (!folder.empty()) return FolderSource(folder);
  const std::string& name = dataset.info().source;
  const bool installed = name == kThirteen || FindInstalledSource(name.substr(0, name.find('+')));
  if (installed) return OpenInstalledSources(name);
  return std::unique_ptr<ModelSource>();
}

class Loader {
 public:
  Loader(const Dataset& dataset, const TexturedMeshRequest& request)
      : dataset_(dataset), request_(request) {}

  Status Open(const std::vector<int>& models) {
    entries_.assign(models.size(), kNone);
    if (clusters()) return {};
    TILEGRAD_ASSIGN(source_, OpenSource(dataset_, request_.folder));
    if (!source_) return {};
    std::map<std::pair<std::string, std::string>, std::size_t> places;
    for (std::size_t e = 0; e < source_->entries().size(); ++e)
      places[{source_->entries()[e].class_name, source_->entries()[e].id}] = e;
    for (std::size_t i = 0; i < models.size(); ++i) {
      const auto at = places.find({ClassOf(models[i]), InfoOf(models[i]).id});
      if (at == places.end()) return Changed(models[i], "is not there any more");
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

  Result<std::unique_ptr<TexturedMesh>> Load(int model, std::size_t i) const {
    Mesh mesh;
    if (entries_[i] == kNone) {
      TILEGRAD_ASSIGN(ModelData data, dataset_.Load(model));
      mesh = std::move(data.mesh);
      if (mesh.faces.empty())
        return InvalidArgument("{}: has no mesh to render{}", dataset_.ModelPath(model).string(),
                               clusters() ? "; set stream.share to 0" : "");
    } else {
      TILEGRAD_ASSIGN(mesh, FromSource(model, entries_[i]));
    }
    if (clusters()) {
      mesh = MakeTruthMesh(mesh, static_cast<std::size_t>(request_.max_faces));
    } else {
      CentreUnusedVertices(&mesh);
    }
    for (MeshTexture& texture : mesh.textures)
      texture.image = ShrunkImage(texture.image, request_.max_texture);
    if (request_.crease <= 0) return std::make_unique<TexturedMesh>(std::move(mesh));
    SplitAtCreases(request_.crease, &mesh);
    return std::make_unique<TexturedMesh>(std::move(mesh), NormalSource::kSmooth);
  }

 private:
  bool clusters() const { return request_.max_faces > 0; }
  const ModelInfo& InfoOf(int model) const {
    return dataset_.models()[static_cast<std::size_t>(model)];
  }
  const std::string& ClassOf(int model) const {
    return dataset_.info().classes[static_cast<std::size_t>(InfoOf(model).class_index)];
  }
  Status Changed(int model, const char* how) const {
    return InvalidArgument(
        "{}: the model {}/{} of {} {} there; make the dataset again from what is there now",
        dataset_.folder().string(), ClassOf(model), InfoOf(model).id, source_->name(), how);
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
  const TexturedMeshRequest& request_;
  std::unique_ptr<ModelSource> source_;  // null: the dataset's own meshes
  std::vector<std::size_t> entries_;     // of the models
};

}  // namespace

TexturedMesh::TexturedMesh(Mesh mesh, NormalSource normals)
    : mesh_(std::make_unique<Mesh>(std::move(mesh))),
      scene_(std::make_unique<MeshScene>(*mesh_, SceneOptions(normals))) {}

std::size_t TexturedMesh::bytes() const {
  std::size_t bytes = mesh_->positions.size() * sizeof(glm::vec3) +
                      mesh_->faces.size() * (sizeof(Face) + 3 * sizeof(glm::vec2));
  for (const MeshTexture& texture : mesh_->textures) bytes += texture.image.pixels.size();
  for (const Texture& texture : scene().textures) bytes += texture.texels.size_bytes();
  return bytes;
}

Result<std::vector<TexturedMesh>> LoadTexturedMeshes(
    const Dataset& dataset, const std::vector<int>& models, const TexturedMeshRequest& request,
    const Workers& workers, const ProgressSink& progress, const StopFlag& stop) {
  Loader loader(dataset, request);
  TILEGRAD_TRY(loader.Open(models));
  const std::vector<std::size_t> order = loader.Order();
  std::vector<std::unique_ptr<TexturedMesh>> loaded(models.size());
  std::vector<Status> failures(models.size());
  std::mutex mutex;
  std::atomic<std::size_t> next = 0;
  std::size_t done = 0, bytes = 0;
  workers.For(static_cast<std::size_t>(workers.count()), [&](std::size_t, std::size_t) {
    for (std::size_t n = next++; n < order.size() && !stop; n = next++) {
      const std::size_t i = order[n];
      auto mesh = loader.Load(models[i], i);
      failures[i] = mesh.status();
      if (mesh.ok()) loaded[i] = std::move(*mesh);
      const std::scoped_lock lock(mutex);
      if (loaded[i]) bytes += loaded[i]->bytes();
      if (progress)
        progress({"loading meshes", ++done, order.size(), fmt::format("{:.1f} MB", bytes / 1e6)});
    }
  });
  if (stop) return Cancelled("stopped while loading meshes");
  for (const Status& failure : failures) TILEGRAD_TRY(failure);
  std::vector<TexturedMesh> out;
  for (auto& mesh : loaded) out.push_back(std::move(*mesh));
  return out;
}

ImageU8 ShrunkImage(const ImageU8& image, int side) {
  const int longest = std::max(image.width, image.height);
  if (longest <= side) return image;
  const auto shorter = [&](int n) {
    return std::max(1, static_cast<int>(static_cast<std::int64_t>(n) * side / longest));
  };
  ImageU8 out(shorter(image.width), shorter(image.height), image.channels);
  // The first of the pixels behind pixel i of an axis, and the one behind its last.
  const auto first = [](int i, int from, int to) {
    return static_cast<int>(static_cast<std::int64_t>(i) * from / to);
  };
  for (int y = 0; y < out.height; ++y) {
    const int top = first(y, image.height, out.height),
              bottom = first(y + 1, image.height, out.height);
    for (int x = 0; x < out.width; ++x) {
      const int left = first(x, image.width, out.width),
                right = first(x + 1, image.width, out.width);
      for (int c = 0; c < image.channels; ++c) {
        std::int64_t sum = 0;
        for (int v = top; v < bottom; ++v) {
          for (int u = left; u < right; ++u) sum += image.at(u, v)[c];
        }
        const std::int64_t count = static_cast<std::int64_t>(bottom - top) * (right - left);
        out.at(x, y)[c] = static_cast<std::uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return out;
}

}  // namespace tilegrad::train
