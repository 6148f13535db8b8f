// SPDX-License-Identifier: Apache-2.0
// The naive renderer: every face for every pixel, scalar, made of the reference kernels. It is the
// truth that tests hold the Renderer to, with T = double or std::complex<double> (complex step),
// and the yardstick of the benchmarks with T = float. One scene at a time; inputs are not checked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "raster/conventions.h"
#include "raster/interpolate_ref.h"
#include "raster/near_clip.h"
#include "raster/project_ref.h"
#include "raster/soft_mask/soft_mask_ref.h"
#include "raster/visibility_ref.h"
#include "render/alpha/paper_bin.h"
#include "render/pipeline/frame_layout.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// A scene on the screen: the mesh after near clipping, and attributes in its layout.
template <class T>
struct PreparedScene {
  raster::ScreenMeshBuffersT<T> buffers;
  raster::ScreenMeshT<T> mesh;
  AlignedVector<T> clipped_attributes;  // empty where nothing was clipped
  raster::AttributeViewT<const T> attributes;
  std::vector<std::int32_t> soft_faces;  // that take part in alpha
  raster::SoftScale<T> scale;
  std::vector<raster::NdcFace<T>> paper_faces;  // soft_faces, where AlphaRule::kPaper asks for them
};

template <class T>
void PrepareRef(const PipelineSceneT<T>& scene, const RenderOptions& options,
                PreparedScene<T>* out) {
  raster::ProjectRef(FaceSourceOf(scene, options), options.width, options.height, &out->buffers);
  out->mesh = out->buffers.View();
  out->attributes = AttributesOf(scene);
  out->scale = {T(2.0 / options.width), T(2.0 / options.height), T(1.0 / options.delta)};
  for (std::size_t f = 0; f < out->mesh.faces(); ++f) {
    if ((out->mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
    out->soft_faces.push_back(static_cast<std::int32_t>(f));
    if (options.alpha_rule == AlphaRule::kPaper)
      out->paper_faces.push_back(NdcFaceOf(out->mesh, f));
  }
  if (!out->mesh.was_clipped()) return;
  out->clipped_attributes.resize(raster::AttributeRows(out->mesh, scene.rate) *
                                 static_cast<std::size_t>(scene.channels));
  raster::ClipAttributes<T>(out->mesh, scene.faces, out->attributes, out->clipped_attributes);
  out->attributes.values = out->clipped_attributes;
}

// Alpha of a background pixel by the rule that the options ask for.
template <class T>
T BackgroundAlphaRef(const PreparedScene<T>& prepared, const RenderOptions& options, const T& px,
                     const T& py) {
  if (options.alpha_rule == AlphaRule::kPaper) {
    return raster::PaperAlphaRef<T>(prepared.paper_faces, NdcX(px, options.width),
                                    NdcY(py, options.height), PaperRuleOf(options));
  }
  return raster::SoftAlphaRef<T>(prepared.mesh, prepared.soft_faces, px, py, prepared.scale);
}

// One pixel of the smooth images, given its face of the prepared mesh. `frame` holds one image.
template <class T>
void ShadePixelRef(const PipelineSceneT<T>& scene, const PreparedScene<T>& prepared,
                   const RenderOptions& options, int column, int row, std::int32_t face,
                   PipelineFrameT<T>* frame) {
  const auto width = static_cast<std::size_t>(options.width);
  const std::size_t plane = width * static_cast<std::size_t>(options.height);
  const std::size_t pixel =
      static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
  const T px = T(column) + T(0.5), py = T(row) + T(0.5);
  const bool background = face == raster::kNoFace;
  if (!frame->alpha.empty()) {
    frame->alpha[pixel] = background ? BackgroundAlphaRef(prepared, options, px, py) : T(1);
  }
  std::vector<T> values(static_cast<std::size_t>(frame->channels), T(0));
  T source[3] = {T(0), T(0), T(0)};
  T depth = T(std::numeric_limits<double>::infinity());
  if (!background) {
    const auto f = static_cast<std::size_t>(face);
    const auto weights = raster::PixelWeightsRef(
        prepared.mesh, raster::MakeFacePlane(prepared.mesh, f), f, options.interpolation, px, py);
    raster::InterpolateRef<T>(prepared.mesh, prepared.attributes, f, weights, values);
    raster::SourceWeights<T>(prepared.mesh, scene.faces, f, weights.w, source);
    depth = T(1) / raster::MakeDepthPlane(prepared.mesh, f).At(px, py);
  }
  for (std::size_t c = 0; c < values.size(); ++c) frame->attributes[c * plane + pixel] = values[c];
  if (!frame->depth.empty()) frame->depth[pixel] = depth;
  for (std::size_t k = 0; k < 2 && !frame->barycentrics.empty(); ++k) {
    frame->barycentrics[k * plane + pixel] = source[k + 1];
  }
}

struct RowRange {
  int begin, end;
};

// The smooth images of rows [begin, end), with visibility given as ids of the scene's faces [H,W].
template <class T>
void RenderRefWithFaces(const PipelineSceneT<T>& scene, const RenderOptions& options,
                        const Outputs& request, std::span<const std::int32_t> face_ids,
                        RowRange rows, PipelineFrameT<T>* frame) {
  PreparedScene<T> prepared;
  PrepareRef(scene, options, &prepared);
  SizeFrame(1, scene.channels, options, request, frame);
  frame->face_ids.assign(face_ids.begin(), face_ids.end());
  for (int i = rows.begin; i < rows.end; ++i) {
    for (int j = 0; j < options.width; ++j) {
      const std::int32_t id = face_ids[static_cast<std::size_t>(i) * options.width + j];
      ShadePixelRef(scene, prepared, options, j, i, raster::PieceAt(prepared.mesh, id, j, i),
                    frame);
    }
  }
}

// Ids of the scene's faces [H,W] seen in rows [begin, end); -1 elsewhere.
template <class T>
std::vector<std::int32_t> FaceIdsRef(const PipelineSceneT<T>& scene, const RenderOptions& options,
                                     RowRange rows) {
  PreparedScene<T> prepared;
  PrepareRef(scene, options, &prepared);
  std::vector<std::int32_t> ids(static_cast<std::size_t>(options.width) * options.height,
                                raster::kNoFace);
  raster::VisibilityRef<T>(prepared.mesh, rows.begin, rows.end, ids);
  for (std::int32_t& id : ids) {
    if (id >= 0) id = prepared.mesh.source_face[static_cast<std::size_t>(id)];
  }
  return ids;
}

template <class T>
void RenderRef(const PipelineSceneT<T>& scene, const RenderOptions& options, const Outputs& request,
               PipelineFrameT<T>* frame) {
  const RowRange all{0, options.height};
  RenderRefWithFaces<T>(scene, options, request, FaceIdsRef(scene, options, all), all, frame);
}

// Gradients of a prepared scene, before projection's adjoint.
template <class T>
struct PreparedGradients {
  std::vector<T> storage[4];
  raster::ScreenGradientsT<T> screen;
  std::vector<T> attribute_storage;
  raster::AttributeViewT<T> attributes;

  PreparedGradients(const PipelineSceneT<T>& scene, const PreparedScene<T>& prepared) {
    for (auto& array : storage) array.assign(prepared.mesh.vertices(), T(0));
    screen = {storage[0], storage[1], storage[2],
              std::span<T>(storage[3]).first(prepared.mesh.clipped.size())};
    attribute_storage.assign(
        raster::AttributeRows(prepared.mesh, scene.rate) * static_cast<std::size_t>(scene.channels),
        T(0));
    attributes = {attribute_storage, scene.channels, scene.rate};
  }
};

template <class T>
void BackgroundAlphaRefBackward(const PreparedScene<T>& prepared, const RenderOptions& options,
                                const T& px, const T& py, const T& d_alpha,
                                PreparedGradients<T>* d) {
  const auto add = [&](std::size_t n, int corner, const T& d_x, const T& d_y) {
    const auto f = static_cast<std::size_t>(prepared.soft_faces[n]);
    const auto v = static_cast<std::size_t>(prepared.mesh.vertex(f, corner));
    d->screen.d_x[v] += d_x;
    d->screen.d_y[v] += d_y;
  };
  if (options.alpha_rule == AlphaRule::kAllFaces) {
    raster::SoftAlphaRefBackward<T>(prepared.mesh, prepared.soft_faces, px, py, prepared.scale,
                                    d_alpha, add);
    return;
  }
  std::vector<raster::NdcFace<T>> d_faces(prepared.paper_faces.size());
  raster::PaperAlphaRefBackward<T>(prepared.paper_faces, NdcX(px, options.width),
                                   NdcY(py, options.height), PaperRuleOf(options), d_alpha,
                                   d_faces);
  for (std::size_t n = 0; n < d_faces.size(); ++n) {
    for (int k = 0; k < 3; ++k) {
      add(n, k, d_faces[n].x[k] * prepared.scale.x, -d_faces[n].y[k] * prepared.scale.y);
    }
  }
}

// Adds the adjoint of one pixel; `d_frame` holds one image.
template <class T>
void ShadePixelRefBackward(const PreparedScene<T>& prepared, const RenderOptions& options,
                           int column, int row, std::int32_t face,
                           const PipelineCotangentsT<T>& d_frame, PreparedGradients<T>* d) {
  const auto width = static_cast<std::size_t>(options.width);
  const std::size_t plane = width * static_cast<std::size_t>(options.height);
  const std::size_t pixel =
      static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
  const T px = T(column) + T(0.5), py = T(row) + T(0.5);
  if (face == raster::kNoFace) {
    if (d_frame.alpha.empty()) return;
    BackgroundAlphaRefBackward(prepared, options, px, py, d_frame.alpha[pixel], d);
    return;
  }
  if (d_frame.attributes.empty()) return;
  std::vector<T> d_out(static_cast<std::size_t>(prepared.attributes.channels));
  for (std::size_t c = 0; c < d_out.size(); ++c) d_out[c] = d_frame.attributes[c * plane + pixel];
  const auto f = static_cast<std::size_t>(face);
  const auto face_plane = raster::MakeFacePlane(prepared.mesh, f);
  const auto weights =
      raster::PixelWeightsRef(prepared.mesh, face_plane, f, options.interpolation, px, py);
  raster::InterpolateRefBackward<T>(prepared.mesh, prepared.attributes, face_plane, f,
                                    options.interpolation, weights, d_out, d->screen,
                                    d->attributes);
}

// From the screen back to the scene; overwrites what `d_scene` asks for.
template <class T>
void PrepareRefBackward(const PipelineSceneT<T>& scene, const RenderOptions& options,
                        const PreparedScene<T>& prepared, const PreparedGradients<T>& d,
                        PipelineGradientsT<T>* d_scene) {
  if (prepared.mesh.was_clipped()) {
    for (T& x : d_scene->attributes) x = T(0);
    raster::ClipAttributesBackward<T>(prepared.mesh, scene.faces, AttributesOf(scene),
                                      d.attribute_storage, d_scene->attributes, d.screen.d_clip_t);
  } else if (!d_scene->attributes.empty()) {
    std::copy(d.attribute_storage.begin(), d.attribute_storage.end(), d_scene->attributes.begin());
  }
  std::vector<T> d_positions(scene.positions.size(), T(0));
  CameraT<T> d_camera = raster::ZeroCamera<T>();
  std::vector<raster::CameraPoint<T>> d_points(scene.positions.size() / 3, {T(0), T(0), T(0)});
  raster::ProjectRefBackward<T>(FaceSourceOf(scene, options), prepared.mesh, d.screen, d_points,
                                d_positions, &d_camera);
  if (d_scene->camera) d_scene->d_camera = d_camera;
  if (d_scene->positions.empty()) return;
  std::copy(d_positions.begin(), d_positions.end(), d_scene->positions.begin());
}

// As Renderer::Backward, for rows [begin, end) of one image.
template <class T>
void RenderRefBackward(const PipelineSceneT<T>& scene, const RenderOptions& options,
                       std::span<const std::int32_t> face_ids,
                       const PipelineCotangentsT<T>& d_frame, RowRange rows,
                       PipelineGradientsT<T>* d_scene) {
  PreparedScene<T> prepared;
  PrepareRef(scene, options, &prepared);
  PreparedGradients<T> d(scene, prepared);
  for (int i = rows.begin; i < rows.end; ++i) {
    for (int j = 0; j < options.width; ++j) {
      const std::int32_t id = face_ids[static_cast<std::size_t>(i) * options.width + j];
      ShadePixelRefBackward(prepared, options, j, i, raster::PieceAt(prepared.mesh, id, j, i),
                            d_frame, &d);
    }
  }
  PrepareRefBackward(scene, options, prepared, d, d_scene);
}

}  // namespace tilegrad
