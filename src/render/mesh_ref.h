// SPDX-License-Identifier: Apache-2.0
// The screen mesh of the naive renderer (reference.h): projection, near clipping, alpha over all
// faces, and their adjoints; scalar, from the reference kernels. Templates over T = float, double,
// std::complex<double> (complex step) and numbers with error bounds. Inputs are not checked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "raster/interpolate_ref.h"
#include "raster/near_clip.h"
#include "raster/project_ref.h"
#include "raster/soft_mask/soft_mask_ref.h"
#include "render/pipeline/paper_bin.h"
#include "render/pipeline/records.h"

namespace tilegrad {

// The mesh after near clipping, and attributes in its layout.
template <class T>
struct PreparedScene {
  const SceneT<T>* scene = nullptr;
  raster::AttributeViewT<const T> given;  // to interpolate, in the scene's layout
  raster::ScreenMeshBuffersT<T> buffers;
  raster::ScreenMeshT<T> mesh;
  AlignedVector<T> clipped_attributes;  // empty if nothing was clipped
  raster::AttributeViewT<const T> attributes;
  std::vector<std::int32_t> soft_faces;  // the faces that take part in alpha
  raster::SoftScale<T> scale;
  std::vector<raster::NdcFace<T>> paper_faces;  // soft_faces, only for AlphaRule::kPaper
};

// Converts `given` to the layout of the mesh.
template <class T>
void ClipAttributesRef(PreparedScene<T>* out) {
  out->attributes = out->given;
  if (!out->mesh.was_clipped()) return;
  out->clipped_attributes.resize(raster::AttributeRows(out->mesh, out->given.rate) *
                                 static_cast<std::size_t>(out->given.channels));
  raster::ClipAttributes<T>(out->mesh, out->scene->faces, out->given, out->clipped_attributes);
  out->attributes.values = out->clipped_attributes;
}

// Keeps the address of `scene`.
template <class T>
void PrepareRef(const SceneT<T>& scene, const raster::AttributeViewT<const T>& attributes,
                const RenderOptions& options, PreparedScene<T>* out) {
  out->scene = &scene;
  out->given = attributes;
  raster::ProjectRef(FaceSourceOf(scene, options), options.width, options.height, &out->buffers);
  out->mesh = out->buffers.View();
  out->scale = {T(2.0 / options.width), T(2.0 / options.height), T(1.0 / options.delta)};
  for (std::size_t f = 0; f < out->mesh.faces(); ++f) {
    if ((out->mesh.reject[f] & raster::kFaceNotInSoftMask) != 0) continue;
    out->soft_faces.push_back(static_cast<std::int32_t>(f));
    if (options.alpha_rule == AlphaRule::kPaper)
      out->paper_faces.push_back(NdcFaceOf(out->mesh, f));
  }
  ClipAttributesRef(out);
}

// Alpha of a background pixel, by the alpha rule of the options.
template <class T>
T BackgroundAlphaRef(const PreparedScene<T>& prepared, const RenderOptions& options, const T& px,
                     const T& py) {
  if (options.alpha_rule == AlphaRule::kPaper) {
    return raster::PaperAlphaRef<T>(prepared.paper_faces, NdcX(px, options.width),
                                    NdcY(py, options.height), PaperRuleOf(options));
  }
  return raster::SoftAlphaRef<T>(prepared.mesh, prepared.soft_faces, px, py, prepared.scale);
}

// Gradients of a prepared scene, before the adjoint of projection.
template <class T>
struct PreparedGradients {
  std::vector<T> storage[4];
  raster::ScreenGradientsT<T> screen;
  std::vector<T> attribute_storage;
  raster::AttributeViewT<T> attributes;

  explicit PreparedGradients(const PreparedScene<T>& prepared) {
    const auto& [values, channels, rate] = prepared.given;
    for (auto& array : storage) array.assign(prepared.mesh.vertices(), T(0));
    screen = {storage[0], storage[1], storage[2],
              std::span<T>(storage[3]).first(prepared.mesh.clipped.size())};
    attribute_storage.assign(
        raster::AttributeRows(prepared.mesh, rate) * static_cast<std::size_t>(channels), T(0));
    attributes = {attribute_storage, channels, rate};
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

// Gradients of the inputs of PrepareRef.
template <class T>
struct MeshGradients {
  std::vector<T> positions, attributes;  // shapes of scene->positions and given.values
  CameraT<T> camera;
};

// Adjoint of PrepareRef: from the screen to the scene.
template <class T>
MeshGradients<T> PrepareRefBackward(const RenderOptions& options, const PreparedScene<T>& prepared,
                                    const PreparedGradients<T>& d) {
  const SceneT<T>& scene = *prepared.scene;
  MeshGradients<T> out{std::vector<T>(scene.positions.size(), T(0)), d.attribute_storage,
                       raster::ZeroCamera<T>()};
  if (prepared.mesh.was_clipped()) {
    out.attributes.assign(prepared.given.values.size(), T(0));
    raster::ClipAttributesBackward<T>(prepared.mesh, scene.faces, prepared.given,
                                      d.attribute_storage, out.attributes, d.screen.d_clip_t);
  }
  std::vector<raster::CameraPoint<T>> d_points(scene.positions.size() / 3, {T(0), T(0), T(0)});
  raster::ProjectRefBackward<T>(FaceSourceOf(scene, options), prepared.mesh, d.screen, d_points,
                                out.positions, &out.camera);
  return out;
}

}  // namespace tilegrad
