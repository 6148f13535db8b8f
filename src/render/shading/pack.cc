// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pack.h"

#include <cstddef>

#include "render/shading/direction_scale.h"

namespace tilegrad {
namespace {

enum class Rows { kVertex, kCorner, kFace };

Rows RowsOf(Rate rate) { return rate == Rate::kVertex ? Rows::kVertex : Rows::kCorner; }

Rows RowsOfStream(const Scene& scene, const SceneStream<float>& stream) {
  if (stream.what != Varying::kNormal || scene.shading.normals == Normals::kGiven) {
    return RowsOf(stream.rate);
  }
  return scene.shading.normals == Normals::kFlat ? Rows::kFace : Rows::kVertex;
}

// Numbers to interpolate, their stride, and what a row belongs to.
struct Source {
  const float* values;
  std::size_t stride;
  Rows rows;
};

Source SourceOf(const Scene& scene, const SceneNormals& normals, Varying what) {
  const SceneStream<float> stream = StreamOf(scene, what);
  const Rows rows = RowsOfStream(scene, stream);
  if (what != Varying::kNormal || scene.shading.normals == Normals::kGiven) {
    return {stream.values.data(), static_cast<std::size_t>(stream.width), rows};
  }
  return {normals.empty() ? nullptr : normals[0].unit.data(),
          sizeof(shade::UnitVector<float>) / sizeof(float), rows};
}

std::size_t PackedRows(const Scene& scene, const VaryingSet& set) {
  return set.rate == Rate::kVertex ? scene.positions.size() / 3 : scene.faces.size();
}

// Calls visit(row of the packed array, row of the stream).
template <class Visit>
void ForEachRow(const Scene& scene, Rate packed, Rows rows, const Visit& visit) {
  if (packed == Rate::kVertex) {
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

void DeriveNormals(const Scene& scene, SceneNormals* normals) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) shade::SmoothNormals(mesh, normals);
  if (scene.shading.normals == Normals::kFlat) shade::FlatNormals(mesh, normals);
}

void PackVaryings(const Scene& scene, const VaryingSet& set, const SceneNormals& normals,
                  AlignedVector<float>* out) {
  const auto channels = static_cast<std::size_t>(set.channels());
  out->resize(PackedRows(scene, set) * channels);
  if (out->empty()) return;
  for (std::size_t i = 0; i < kVaryings; ++i) {
    const auto what = static_cast<Varying>(i);
    if (!set[what]) continue;
    const Source source = SourceOf(scene, normals, what);
    const auto width = static_cast<std::size_t>(set.width(what));
    const float scale = StreamScale(scene, what);
    float* const to = out->data() + set.first(what);
    ForEachRow(scene, set.rate, source.rows, [&](std::size_t row, std::size_t from) {
      for (std::size_t c = 0; c < width; ++c) {
        to[row * channels + c] = scale * source.values[from * source.stride + c];
      }
    });
  }
}

void AddStream(const Scene& scene, const VaryingSet& set, Varying what,
               std::span<const float> packed, std::span<float> stream) {
  if (packed.empty()) return;
  const auto channels = static_cast<std::size_t>(set.channels());
  const auto width = static_cast<std::size_t>(set.width(what));
  const float scale = StreamScale(scene, what);
  const float* const from = packed.data() + set.first(what);
  const Rows rows = RowsOfStream(scene, StreamOf(scene, what));
  ForEachRow(scene, set.rate, rows, [&](std::size_t row, std::size_t to) {
    for (std::size_t c = 0; c < width; ++c) {
      stream[to * width + c] += scale * from[row * channels + c];
    }
  });
}

void AddNormalsAdjoint(const Scene& scene, const SceneNormals& normals,
                       std::span<shade::Vec3<float>> d_units, std::span<float> d_positions) {
  const shade::TriangleMesh mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) {
    shade::SmoothNormalsAdjoint(mesh, normals, d_units, d_positions);
  } else if (scene.shading.normals == Normals::kFlat) {
    shade::FlatNormalsAdjoint(mesh, normals, d_units, d_positions);
  }
}

}  // namespace tilegrad
