// SPDX-License-Identifier: Apache-2.0
#include "train/data/photographs/pascal3d_masks.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/image_file.h"
#include "render/picture/mesh_scene.h"

namespace tilegrad::train {
namespace {

using Color = std::array<std::uint8_t, 3>;

// PASCAL VOC's palette: bits of the index go to red, green and blue in turn, the lowest first.
Color VocColor(int index) {
  Color out = {};
  for (int bit = 7; index > 0; --bit, index >>= 3) {
    for (int c = 0; c < 3; ++c)
      out[c] = static_cast<std::uint8_t>(out[c] | ((index >> c) & 1) << bit);
  }
  return out;
}

bool IsEmpty(const PhotoMask& mask) {
  return std::ranges::find(mask.inside, true) == mask.inside.end();
}

// Faces are triangles, whose corners count from 1.
Result<Mesh> ReadCadModel(const io::MatPlace& models, std::size_t index) {
  TILEGRAD_ASSIGN(const io::MatPlace vertices, models.Field(index, "vertices"));
  TILEGRAD_ASSIGN(const io::MatPlace faces, models.Field(index, "faces"));
  const std::size_t points = vertices.array().dims[0], triangles = faces.array().dims[0];
  TILEGRAD_TRY(vertices.ExpectSize(points, 3));
  TILEGRAD_TRY(faces.ExpectSize(triangles, 3));
  TILEGRAD_ASSIGN(const auto v, vertices.Numbers(3 * points));
  TILEGRAD_ASSIGN(const auto f, faces.Numbers(3 * triangles));
  Mesh out;
  for (std::size_t i = 0; i < points; ++i)
    out.positions.push_back({static_cast<float>(v[i]), static_cast<float>(v[2 * points + i]),
                             static_cast<float>(-v[points + i])});
  if (!std::ranges::all_of(f,
                           [&](double corner) { return corner >= 1 && corner <= double(points); }))
    return InvalidArgument("{}: corners beyond its {} vertices", faces.where(), points);
  for (std::size_t i = 0; i < triangles; ++i)
    out.faces.push_back({static_cast<std::int32_t>(f[i]) - 1,
                         static_cast<std::int32_t>(f[triangles + i]) - 1,
                         static_cast<std::int32_t>(f[2 * triangles + i]) - 1});
  if (out.faces.empty()) return InvalidArgument("{}: no triangles in it", faces.where());
  TILEGRAD_TRY(Validate(out).Within(faces.where()));
  return out;
}

}  // namespace

Result<std::vector<Mesh>> ReadCadModels(const Path& root, const std::string& class_name,
                                        BrokenMembers* broken) {
  std::vector<Mesh> out;
  const Path file = root / "CAD" / (class_name + ".mat");
  if (!PathExists(file)) return out;
  TILEGRAD_ASSIGN(const io::MatFile mat, io::LoadMat(file));
  TILEGRAD_ASSIGN(const io::MatPlace models, io::MatPlace::Variable(mat, class_name));
  TILEGRAD_TRY(models.ExpectStruct());
  for (std::size_t i = 0; i < models.places(); ++i) {
    auto mesh = ReadCadModel(models, i);
    if (!mesh.ok())
      broken->Add(fmt::format("CAD/{}.mat({})", class_name, i + 1), mesh.status().message());
    out.push_back(mesh.ok() ? std::move(*mesh) : Mesh());
  }
  return out;
}

Pascal3dMasks::Pascal3dMasks(const Path& root, const Path& masks, const std::vector<Mesh>& cad)
    : root_(root), masks_(masks), cad_(cad), alone_(1), renderer_(alone_) {}

Result<MaskOrigin> Pascal3dMasks::Find(const MaskRequest& request, PhotoMask* mask) {
  const std::string stem = Path(request.id).stem().string();
  if (!masks_.empty()) {
    const Path folder = masks_ / Path(request.id).parent_path();
    const Path own = folder / fmt::format("{}_{}.png", stem, request.object.number);
    TILEGRAD_ASSIGN(bool found, FromImage(own, request, false, mask));
    if (!found && request.alone) {
      TILEGRAD_ASSIGN(found, FromImage(folder / (stem + ".png"), request, false, mask));
    }
    if (found) return MaskOrigin::kFolder;
  }
  const Path voc = root_ / "PASCAL/VOCdevkit/VOC2012/SegmentationObject" / (stem + ".png");
  TILEGRAD_ASSIGN(const bool found, FromImage(voc, request, true, mask));
  if (found) return MaskOrigin::kVoc;
  const int cad = request.object.cad;
  const bool whole =
      cad >= 1 && cad <= std::ssize(cad_) && !cad_[static_cast<std::size_t>(cad) - 1].faces.empty();
  if (!whole) return MaskOrigin::kNone;
  TILEGRAD_TRY(FromCad(request, mask));
  return IsEmpty(*mask) ? MaskOrigin::kNone : MaskOrigin::kCad;
}

Result<bool> Pascal3dMasks::FromImage(const Path& file, const MaskRequest& request, bool voc,
                                      PhotoMask* mask) {
  if (!PathExists(file)) return false;
  TILEGRAD_ASSIGN(ImageU8 read, io::LoadImage(file));
  const ImageU8 image = io::ToColor(std::move(read));
  const auto [width, height] = request.size;
  if (image.width != width || image.height != height)
    return InvalidArgument("{}: {} x {} pixels, but its picture has {} x {}", file.string(),
                           image.width, image.height, width, height);
  *mask = {width, height, {}};
  const Color color = VocColor(request.object.number);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint8_t* const at = image.at(x, y);
      mask->inside.push_back(voc ? std::equal(color.begin(), color.end(), at) : at[0] >= 128);
    }
  }
  return !IsEmpty(*mask);
}

Status Pascal3dMasks::FromCad(const MaskRequest& request, PhotoMask* mask) {
  const Mesh& mesh = cad_[static_cast<std::size_t>(request.object.cad) - 1];
  MeshSceneOptions options;
  options.blend = false;
  const MeshScene made(mesh, options);
  Scene scene = made.scene();
  scene.camera = CameraCast<float>(CameraOfViewpoint(request.object.viewpoint));
  const auto [width, height] = request.size;
  Picture seen;
  TILEGRAD_TRY(renderer_.Render(
      scene, {.width = width, .height = height, .color = false, .depth = true}, &seen));
  *mask = {width, height, {}};
  for (const float depth : seen.depth) mask->inside.push_back(std::isfinite(depth));
  return {};
}

}  // namespace tilegrad::train
