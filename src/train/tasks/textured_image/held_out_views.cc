// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/held_out_views.h"

#include "base/error.h"

namespace tilegrad::train {
namespace {

constexpr std::uint64_t kHeldOutSeed = 0x68656c64;

std::vector<float> Copied(std::span<const float> pictures) {
  return {pictures.begin(), pictures.end()};
}

}  // namespace

Result<HeldOutViews> HeldOutViews::Load(const Request& request, const Workers& workers,
                                        const ProgressSink& progress, const StopFlag& stop) {
  HeldOutViews out;
  out.models_ = request.models;
  TILEGRAD_ASSIGN(MeshCache meshes,
                  OpenTexturedMeshes(request.dataset, request.models, request.config.stream.meshes,
                                     workers, progress, stop));
  const DatasetInfo& info = request.dataset.info();
  out.stream_.emplace(
      TexturedStream::Job{WithoutChanges(request.config.stream), request.config.light, info.camera,
                          info.image_size, kHeldOutSeed},
      std::move(meshes), workers);
  return out;
}

Result<HeldOutViews::Views> HeldOutViews::Draw(std::size_t i, int count) {
  Views out;
  out.views.resize(static_cast<std::size_t>(count));
  const auto position = static_cast<std::uint64_t>(models_[i]);
  TILEGRAD_TRY(stream_->Render(static_cast<int>(i), position, 0, out.views).status());
  TILEGRAD_TRY(Fill(&out));
  return out;
}

Result<HeldOutViews::Views> HeldOutViews::Show(std::size_t i, std::vector<TexturedView> views) {
  Views out;
  out.views = views;
  const auto position = static_cast<std::uint64_t>(models_[i]);
  TILEGRAD_TRY(stream_->Render(static_cast<int>(i), position, 0, out.views).status());
  out.views = std::move(views);
  TILEGRAD_TRY(stream_->Change(0, out.views));
  TILEGRAD_TRY(Fill(&out));
  return out;
}

// The pictures of the object as it was set up last.
Status HeldOutViews::Fill(Views* out) {
  TILEGRAD_ASSIGN(auto pictures, stream_->Again(0, Appearance::kLit));
  out->lit = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kTexture));
  out->texture = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kLight));
  out->light = Copied(pictures);
  TILEGRAD_ASSIGN(pictures, stream_->Again(0, Appearance::kNormals));
  out->normals = Copied(pictures);
  return {};
}

}  // namespace tilegrad::train
