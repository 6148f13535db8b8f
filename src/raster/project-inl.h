// SPDX-License-Identifier: Apache-2.0
// Vector body of project.h: lanes are vertices.
#if defined(TILEGRAD_RASTER_PROJECT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TILEGRAD_RASTER_PROJECT_INL_H_
#undef TILEGRAD_RASTER_PROJECT_INL_H_
#else
#define TILEGRAD_RASTER_PROJECT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstring>

#include "base/simd_math-inl.h"
#include "raster/project.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::raster {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
namespace simd = tilegrad::HWY_NAMESPACE;

using ProjectTag = HWY_CAPPED(float, 16);
using ProjectVec = hn::Vec<ProjectTag>;

// Camera-space coordinates of a vector of vertices.
struct CameraLanes {
  ProjectVec x, y, depth;
};

HWY_INLINE CameraLanes ToCameraLanes(ProjectTag d, const Camera& camera, ProjectVec px,
                                     ProjectVec py, ProjectVec pz) {
  const float* r = camera.rotation;
  const float* t = camera.translation;
  const auto row = [&](int i) HWY_ATTR {
    auto sum = hn::MulAdd(hn::Set(d, r[3 * i]), px, hn::Set(d, t[i]));
    sum = hn::MulAdd(hn::Set(d, r[3 * i + 1]), py, sum);
    return hn::MulAdd(hn::Set(d, r[3 * i + 2]), pz, sum);
  };
  return {row(0), row(1), hn::Neg(row(2))};
}

// The destinations of a vector of vertices.
struct VertexPlaces {
  float *x, *y, *depth, *inverse_depth;
  float* packed;  // [Lanes][4]
};

// Projects one vector of vertices. Returns whether all are visible and finite.
HWY_INLINE bool ProjectLanes(ProjectTag d, const Camera& camera, const float* positions,
                             const VertexPlaces& to) {
  ProjectVec px, py, pz;
  hn::LoadInterleaved3(d, positions, px, py, pz);
  const CameraLanes p = ToCameraLanes(d, camera, px, py, pz);
  const auto visible = hn::Ge(p.depth, hn::Set(d, camera.near_plane));
  const auto inverse = hn::IfThenElseZero(visible, hn::Div(hn::Set(d, 1.0f), p.depth));
  const auto u = hn::Mul(p.x, inverse), v = hn::Mul(p.y, inverse);
  const auto sx =
      hn::IfThenElseZero(visible, hn::MulAdd(hn::Set(d, camera.fx), u, hn::Set(d, camera.cx)));
  const auto sy =
      hn::IfThenElseZero(visible, hn::NegMulAdd(hn::Set(d, camera.fy), v, hn::Set(d, camera.cy)));
  hn::StoreU(sx, d, to.x);
  hn::StoreU(sy, d, to.y);
  hn::StoreU(p.depth, d, to.depth);
  hn::StoreU(inverse, d, to.inverse_depth);
  hn::StoreInterleaved4(sx, sy, inverse, p.depth, d, to.packed);
  // v - v is NaN, and not zero, unless v is finite.
  const auto zero = hn::Add(hn::Sub(sx, sx), hn::Add(hn::Sub(sy, sy), hn::Sub(p.depth, p.depth)));
  return hn::AllTrue(d, hn::And(visible, hn::Eq(zero, hn::Zero(d))));
}

// Projects vertices [begin, n) into out's arrays of size V. Returns whether all are visible and
// finite.
bool ProjectVertices(const FaceSource<float>& source, std::size_t begin, std::size_t n,
                     ScreenMeshBuffers* out) {
  static_assert(sizeof(PackedVertexT<float>) == 4 * sizeof(float));
  const ProjectTag d;
  const std::size_t lanes = hn::Lanes(d);
  const float* in = source.positions.data();
  bool plain = true;
  std::size_t i = begin;
  const auto places = [&](std::size_t at) HWY_ATTR {
    return VertexPlaces{&out->x[at], &out->y[at], &out->depth[at], &out->inverse_depth[at],
                        &out->packed[at].x};
  };
  for (; i + lanes <= n; i += lanes) {
    plain &= ProjectLanes(d, *source.camera, in + 3 * i, places(i));
  }
  if (i == n) return plain;
  float rest[3 * 16], results[4][16], packed[4 * 16];
  for (std::size_t k = 0; k < lanes; ++k) {  // lanes beyond repeat the last vertex
    std::memcpy(rest + 3 * k, in + 3 * HWY_MIN(i + k, n - 1), 3 * sizeof(float));
  }
  plain &= ProjectLanes(d, *source.camera, rest,
                        {results[0], results[1], results[2], results[3], packed});
  const VertexPlaces at = places(i);
  float* const to[4] = {at.x, at.y, at.depth, at.inverse_depth};
  for (int a = 0; a < 4; ++a) std::memcpy(to[a], results[a], (n - i) * sizeof(float));
  std::memcpy(at.packed, packed, 4 * (n - i) * sizeof(float));
  return plain;
}

// Splits faces [begin, end) into one array per corner, and their numbers.
void SplitSomeFaces(std::span<const std::int32_t> faces, std::size_t begin, std::size_t end,
                    FaceCorners* out) {
  const hn::RebindToSigned<ProjectTag> di;
  const std::size_t lanes = hn::Lanes(di);
  std::size_t f = begin;
  for (; f + lanes <= end; f += lanes) {
    hn::Vec<decltype(di)> v[3];
    hn::LoadInterleaved3(di, &faces[3 * f], v[0], v[1], v[2]);
    hn::StoreU(v[0], di, &out->v0[f]);
    hn::StoreU(v[1], di, &out->v1[f]);
    hn::StoreU(v[2], di, &out->v2[f]);
    hn::StoreU(simd::CountFrom(di, static_cast<std::int32_t>(f)), di, &out->source_face[f]);
  }
  for (; f < end; ++f) {
    out->v0[f] = faces[3 * f];
    out->v1[f] = faces[3 * f + 1];
    out->v2[f] = faces[3 * f + 2];
    out->source_face[f] = static_cast<std::int32_t>(f);
  }
}

// Sums over vertices of the sixteen entries of a camera's gradient, per lane.
struct CameraSums {
  ProjectVec rotation[9], translation[3], fx, fy, cx, cy;
};

HWY_INLINE CameraSums ZeroCameraSums(ProjectTag d) {
  CameraSums sums;
  for (auto& s : sums.rotation) s = hn::Zero(d);
  for (auto& s : sums.translation) s = hn::Zero(d);
  sums.fx = sums.fy = sums.cx = sums.cy = hn::Zero(d);
  return sums;
}

HWY_INLINE void StoreCameraSums(ProjectTag d, const CameraSums& sums, Camera* camera) {
  const auto total = [&](ProjectVec v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  for (int i = 0; i < 9; ++i) camera->rotation[i] = total(sums.rotation[i]);
  for (int i = 0; i < 3; ++i) camera->translation[i] = total(sums.translation[i]);
  camera->fx = total(sums.fx);
  camera->fy = total(sums.fy);
  camera->cx = total(sums.cx);
  camera->cy = total(sums.cy);
  camera->near_plane = 0;
}

// One vector of vertices of the adjoint: d_screen [Lanes][d_x, d_y, d_inverse_depth, -]. Writes
// d_positions [Lanes,3].
HWY_INLINE void ProjectLanesBackward(ProjectTag d, const Camera& camera, const float* positions,
                                     const float* d_screen, float* d_positions, CameraSums* sums) {
  ProjectVec position[3], d_x, d_y, d_inverse, unused;
  hn::LoadInterleaved3(d, positions, position[0], position[1], position[2]);
  const CameraLanes p = ToCameraLanes(d, camera, position[0], position[1], position[2]);
  const auto inverse = hn::Div(hn::Set(d, 1.0f), p.depth);
  const auto u = hn::Mul(p.x, inverse), v = hn::Mul(p.y, inverse);
  hn::LoadInterleaved4(d, d_screen, d_x, d_y, d_inverse, unused);
  const auto d_u = hn::Mul(hn::Set(d, camera.fx), d_x);
  const auto d_v = hn::Neg(hn::Mul(hn::Set(d, camera.fy), d_y));
  auto d_z = hn::Mul(d_inverse, inverse);
  d_z = hn::Mul(hn::MulAdd(d_u, u, hn::MulAdd(d_v, v, d_z)), inverse);  // z = -depth
  const ProjectVec d_camera[3] = {hn::Mul(d_u, inverse), hn::Mul(d_v, inverse), d_z};
  ProjectVec d_position[3];
  for (int c = 0; c < 3; ++c) {
    d_position[c] = hn::Mul(hn::Set(d, camera.rotation[c]), d_camera[0]);
    for (int r = 1; r < 3; ++r) {
      d_position[c] =
          hn::MulAdd(hn::Set(d, camera.rotation[3 * r + c]), d_camera[r], d_position[c]);
    }
  }
  hn::StoreInterleaved3(d_position[0], d_position[1], d_position[2], d, d_positions);
  if (sums == nullptr) return;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      sums->rotation[3 * r + c] = hn::MulAdd(d_camera[r], position[c], sums->rotation[3 * r + c]);
    }
    sums->translation[r] = hn::Add(sums->translation[r], d_camera[r]);
  }
  sums->fx = hn::MulAdd(u, d_x, sums->fx);
  sums->cx = hn::Add(sums->cx, d_x);
  sums->fy = hn::NegMulAdd(v, d_y, sums->fy);
  sums->cy = hn::Add(sums->cy, d_y);
}

// The adjoint if no face was cut and every vertex is visible. d_screen [V][4].
void ProjectVerticesBackward(const FaceSource<float>& source, std::span<const float> d_screen,
                             const ProjectGradients& out) {
  const ProjectTag d;
  const std::size_t lanes = hn::Lanes(d), n = source.positions.size() / 3;
  CameraSums sums = ZeroCameraSums(d);
  CameraSums* wanted = out.d_camera == nullptr ? nullptr : &sums;
  float unwanted[3 * 16];
  std::size_t i = 0;
  for (; i + lanes <= n; i += lanes) {
    float* to = out.d_positions.empty() ? unwanted : &out.d_positions[3 * i];
    ProjectLanesBackward(d, *source.camera, &source.positions[3 * i], &d_screen[4 * i], to, wanted);
  }
  if (i < n) {
    float positions[3 * 16], rest[4 * 16] = {}, d_positions[3 * 16];
    for (std::size_t k = 0; k < lanes; ++k) {  // beyond V the last vertex, with gradient 0
      std::memcpy(positions + 3 * k, &source.positions[3 * HWY_MIN(i + k, n - 1)],
                  3 * sizeof(float));
    }
    std::memcpy(rest, &d_screen[4 * i], 4 * (n - i) * sizeof(float));
    ProjectLanesBackward(d, *source.camera, positions, rest, d_positions, wanted);
    if (!out.d_positions.empty()) {
      std::memcpy(&out.d_positions[3 * i], d_positions, 3 * (n - i) * sizeof(float));
    }
  }
  if (out.d_camera != nullptr) StoreCameraSums(d, sums, out.d_camera);
}

}  // namespace HWY_NAMESPACE
}  // namespace tilegrad::raster
HWY_AFTER_NAMESPACE();

#endif
