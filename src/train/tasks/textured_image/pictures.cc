// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/textured_image/pictures.h"

#include "base/error.h"
#include "render/picture/composite.h"
#include "train/data/stream/textured_meshes.h"

namespace tilegrad::train {
namespace {

class PictureRow {
 public:
  PictureRow(const ShownObject& shown, ObjectPictures& pictures, int size)
      : shown_(shown), pictures_(pictures), size_(size) {}

  Result<std::vector<ShownPicture>> Make() {
    const auto& [name, object, truth] = shown_;
    TexturedView view = truth.views[0];
    view.light = object.light;
    AddTruth("input", truth.lit, 0);
    TILEGRAD_TRY(AddPrediction("texture + light", view, Appearance::kLit));
    TILEGRAD_TRY(AddPrediction("texture", view, Appearance::kTexture));
    TILEGRAD_TRY(AddPrediction("light", view, Appearance::kLight));
    AddTruth("true texture", truth.texture, 0);
    AddTruth("true light", truth.light, 0);
    for (std::size_t v = 1; v < truth.views.size(); ++v) {
      TILEGRAD_TRY(AddPrediction("another view", truth.views[v], Appearance::kTexture));
      AddTruth("truth", truth.texture, v);
    }
    Add("map", object.mesh.textures[0].image);
    return std::move(out_);
  }

 private:
  void Add(const std::string& caption, ImageU8 image) {
    out_.push_back({std::move(image), caption, shown_.name + ": " + caption});
  }
  void AddTruth(const std::string& caption, const std::vector<float>& pictures, std::size_t view) {
    Add(caption, OnPaper(shown_.truth.Of(pictures, view), size_));
  }
  Status AddPrediction(const std::string& caption, const TexturedView& view,
                       Appearance appearance) {
    TILEGRAD_ASSIGN(const auto rgba, pictures_.Draw(shown_.object.mesh, view, appearance));
    Add(caption, OnPaper(rgba, size_));
    return {};
  }

  const ShownObject& shown_;
  ObjectPictures& pictures_;
  int size_;
  std::vector<ShownPicture> out_;
};

}  // namespace

Result<std::vector<ShownPicture>> PicturesOf(const ShownObject& shown, ObjectPictures& pictures,
                                             int size) {
  return PictureRow(shown, pictures, size).Make();
}

ImageU8 SheetOf(const std::vector<std::vector<ShownPicture>>& rows, int size) {
  constexpr int kZoom = 2, kGap = 2;
  std::vector<ImageU8> cells;
  for (const auto& row : rows) {
    for (const ShownPicture& picture : row)
      cells.push_back(Enlarged(ShrunkImage(picture.image, size), kZoom));
  }
  return TileImages(cells, static_cast<int>(rows[0].size()), kGap);
}

}  // namespace tilegrad::train
