// SPDX-License-Identifier: Apache-2.0
#include "fit/remesh_scene.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/error.h"
#include "fit/texture_fill.h"
#include "fit/transfer_texture.h"
#include "scene/unwrap.h"

namespace tilegrad::train {
namespace {

constexpr double kBusyShare = 0.15;  // of the vertices

bool IsOfVertices(const ParameterBlock& block) {
  return block.what == Parameter::kPositions || block.what == Parameter::kColors;
}

// Positions, colours if there are any, and the moments of those that are fitted.
VertexRows RowsOf(const FitScene& scene, const std::vector<ParameterBlock>& blocks) {
  std::vector<const float*> parts = {scene.positions.data()};
  if (!scene.colors.empty()) parts.push_back(scene.colors.data());
  for (const ParameterBlock& block : blocks) {
    if (IsOfVertices(block)) parts.insert(parts.end(), {block.m.data(), block.v.data()});
  }
  VertexRows rows{3 * parts.size(), {}};
  rows.values.reserve(rows.width * scene.vertices());
  for (std::size_t v = 0; v < scene.vertices(); ++v)
    for (const float* part : parts)
      rows.values.insert(rows.values.end(), part + 3 * v, part + 3 * v + 3);
  return rows;
}

// Column `part` of the rows, three numbers a vertex.
template <class Array>
void TakePart(const VertexRows& rows, std::size_t part, Array* to) {
  to->resize(3 * rows.count());
  for (std::size_t v = 0; v < rows.count(); ++v)
    std::copy_n(&rows.values[v * rows.width + 3 * part], 3,
                to->begin() + static_cast<std::ptrdiff_t>(3 * v));
}

std::vector<char> BusyVertices(const FitScene& scene, const std::vector<ParameterBlock>& blocks) {
  std::vector<char> busy(scene.vertices(), 0);
  for (const ParameterBlock& block : blocks) {
    if (block.what != Parameter::kPositions || busy.empty()) continue;
    std::vector<float> moves(busy.size());
    for (std::size_t v = 0; v < moves.size(); ++v)
      moves[v] = block.v[3 * v] + block.v[3 * v + 1] + block.v[3 * v + 2];
    std::vector<float> sorted(moves);
    const auto rank =
        static_cast<std::size_t>((1 - kBusyShare) * static_cast<double>(moves.size()));
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(std::min(rank, moves.size() - 1));
    std::nth_element(sorted.begin(), at, sorted.end());
    for (std::size_t v = 0; v < moves.size(); ++v) busy[v] = moves[v] > *at;
  }
  return busy;
}

Result<FitScene> SceneOf(const FitScene& before, const EditMesh::Packed& packed) {
  Mesh mesh;
  mesh.faces = packed.faces;
  for (std::size_t v = 0; v < packed.vertices.count(); ++v)
    mesh.positions.push_back(packed.vertices.Position(static_cast<std::int32_t>(v)));
  if (!before.texture.empty()) {
    const UnwrapOptions options{.width = before.texture.width, .height = before.texture.height};
    TILEGRAD_TRY(Unwrap(options, &mesh).status());
  }
  TILEGRAD_ASSIGN(FitScene charts, SceneOfMesh(mesh));
  FitScene scene = before;
  scene.positions = charts.positions, scene.faces = charts.faces;
  scene.uvs = charts.uvs, scene.uv_indices = charts.uv_indices;
  if (!before.colors.empty()) TakePart(packed.vertices, 1, &scene.colors);
  return scene;
}

void TakeTexture(const FitScene& before, const Workers& workers, RemeshedScene* out) {
  AlignedVector<float> texels(before.texture.pixels.begin(), before.texture.pixels.end());
  std::vector<AlignedVector<float>*> arrays = {&texels};
  for (ParameterBlock& block : out->blocks) {
    if (block.what == Parameter::kTexture) arrays.insert(arrays.end(), {&block.m, &block.v});
  }
  const std::vector<bool> set = TransferTexels(before, out->scene, workers, arrays);
  out->scene.texture.pixels.assign(texels.begin(), texels.end());
  FillUnseenTexels(set, &out->scene);
}

}  // namespace

Result<RemeshedScene> RemeshScene(const FitScene& scene, const std::vector<ParameterBlock>& blocks,
                                  const RemeshLimits& limits, const Workers& workers) {
  for (const ParameterBlock& block : blocks) {
    if (block.what == Parameter::kUv)
      return InvalidArgument("texture coordinates that are fitted are not carried to a new mesh");
  }
  std::vector<Face> faces;
  for (std::size_t i = 0; i < scene.faces.size(); i += 3)
    faces.push_back({scene.faces[i], scene.faces[i + 1], scene.faces[i + 2]});
  TILEGRAD_ASSIGN(EditMesh mesh, EditMesh::Make(RowsOf(scene, blocks), std::move(faces)));
  RemeshedScene out;
  out.count = Remesh(limits, BusyVertices(scene, blocks), &mesh);
  const EditMesh::Packed packed = mesh.Pack();
  TILEGRAD_ASSIGN(out.scene, SceneOf(scene, packed));
  out.blocks = blocks;
  std::size_t part = scene.colors.empty() ? 1 : 2;
  for (ParameterBlock& block : out.blocks) {
    if (!IsOfVertices(block)) continue;
    TakePart(packed.vertices, part, &block.m), TakePart(packed.vertices, part + 1, &block.v);
    part += 2;
  }
  if (!scene.texture.empty()) TakeTexture(scene, workers, &out);
  for (ParameterBlock& block : out.blocks) ReadBlock(out.scene, &block);
  return out;
}

}  // namespace tilegrad::train
