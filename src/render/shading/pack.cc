// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pack.h"

#include <cstddef>

#include "render/shading/direction_scale.h"

namespace tilegrad {
namespace {

enum class Rows { kVertex, kCorner, kFace };

Rows RowsOf(AttributeRate rate) {
  return rate == AttributeRate::kVertex ? Rows::kVertex : Rows::kCorner;
}

// One stream: its numbers, their stride, and what a row belongs to.
struct Stream {
  const float* values;
  std::size_t stride;
  Rows rows;
};

Rows RowsOfStream(const ShadedScene& scene, Varying what) {
  switch (what) {
    case Varying::kColor:
      return RowsOf(scene.colors.rate);
    case Varying::kUv:
      return RowsOf(scene.uvs.rate);
    case Varying::kUser:
      return RowsOf(scene.rate);
    case Varying::kNormal:
      if (scene.model.normals == NormalKind::kFlat) return Rows::kFace;
      return scene.model.normals == NormalKind::kGiven ? RowsOf(scene.normals.rate) : Rows::kVertex;
    default:
      return Rows::kVertex;
  }
}

Stream StreamOf(const ShadedScene& scene, const SceneNormals& normals, Varying what) {
  const Rows rows = RowsOfStream(scene, what);
  switch (what) {
    case Varying::kColor:
      return {scene.colors.values.data(), 3, rows};
    case Varying::kUv:
      return {scene.uvs.values.data(), 2, rows};
    case Varying::kPosition:
      return {scene.positions.data(), 3, rows};
    case Varying::kLightDirection:
      return {scene.light_directions.data(), 3, rows};
    case Varying::kUser:
      return {scene.attributes.data(), static_cast<std::size_t>(scene.channels), rows};
    case Varying::kNormal:
      break;
  }
  if (scene.model.normals == NormalKind::kGiven) return {scene.normals.values.data(), 3, rows};
  return {normals.empty() ? nullptr : normals[0].unit.data(),
          sizeof(shade::UnitVector<float>) / sizeof(float), rows};
}

std::size_t PackedRows(const ShadedScene& scene, const VaryingSet& set) {
  return set.rate == AttributeRate::kVertex ? scene.positions.size() / 3 : scene.faces.size();
}

// Calls visit(row of the packed array, row of the stream).
template <class Visit>
void ForEachRow(const ShadedScene& scene, AttributeRate packed, Rows rows, const Visit& visit) {
  if (packed == AttributeRate::kVertex) {
    for (std::size_t v = 0; v < scene.positions.size() / 3; ++v) visit(v, v);
    return;
  }
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    visit(i, rows == Rows::kVertex   ? static_cast<std::size_t>(scene.faces[i])
             : rows == Rows::kCorner ? i
                                     : i / 3);
  }
}

}  // namespace

void DeriveNormals(const ShadedScene& scene, SceneNormals* normals) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.model.normals == NormalKind::kSmooth) shade::SmoothNormals(mesh, normals);
  if (scene.model.normals == NormalKind::kFlat) shade::FlatNormals(mesh, normals);
}

void PackVaryings(const ShadedScene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out) {
  const auto channels = static_cast<std::size_t>(set.channels());
  out->resize(PackedRows(scene, set) * channels);
  for (std::size_t i = 0; i < kVaryings; ++i) {
    const auto what = static_cast<Varying>(i);
    if (!set[what]) continue;
    const Stream stream = StreamOf(scene, normals, what);
    const auto width = static_cast<std::size_t>(set.width(what));
    const float scale = StreamScale(scene, what);
    float* const to = out->data() + set.first(what);
    ForEachRow(scene, set.rate, stream.rows, [&](std::size_t row, std::size_t from) {
      for (std::size_t c = 0; c < width; ++c) {
        to[row * channels + c] = scale * stream.values[from * stream.stride + c];
      }
    });
  }
}

void AddStream(const ShadedScene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream) {
  const auto channels = static_cast<std::size_t>(set.channels());
  const auto width = static_cast<std::size_t>(set.width(what));
  const float scale = StreamScale(scene, what);
  const float* const from = packed.data() + set.first(what);
  ForEachRow(scene, set.rate, RowsOfStream(scene, what), [&](std::size_t row, std::size_t to) {
    for (std::size_t c = 0; c < width; ++c) {
      stream[to * width + c] += scale * from[row * channels + c];
    }
  });
}

void AddNormalsAdjoint(const ShadedScene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.model.normals == NormalKind::kSmooth) {
    shade::SmoothNormalsAdjoint(mesh, normals, d_units, d_positions);
  } else if (scene.model.normals == NormalKind::kFlat) {
    shade::FlatNormalsAdjoint(mesh, normals, d_units, d_positions);
  }
}

}  // namespace tilegrad
