// SPDX-License-Identifier: Apache-2.0
// The naive renderer: every face for every pixel, every stream at every corner, and pixel_ref.h at
// every pixel; scalar. It is the ground truth for tests of the Renderer, with T = double or
// std::complex<double> (complex step), the implementation of RendererT<double>, and with T = float
// the baseline of benchmarks. One scene at a time; inputs are not checked.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "raster/conventions.h"
#include "raster/visibility_ref.h"
#include "render/frame_images.h"
#include "render/mesh_ref.h"
#include "render/shading/pixel_ref.h"
#include "render/shading/plan.h"
#include "render/shading/run.h"
#include "shade/mesh_normals_ref.h"

namespace tilegrad {

// Rows of an image; clamped to its height.
struct RowRange {
  int begin, end;
};
inline constexpr RowRange kAllRows{0, std::numeric_limits<int>::max()};

// Ids of the scene's faces [H,W] visible in some rows; -1 elsewhere.
template <class T>
std::vector<std::int32_t> FaceIdsRef(const SceneT<T>& scene, const RenderOptions& options,
                                     RowRange rows = kAllRows) {
  PreparedScene<T> prepared;
  PrepareRef(scene, {}, options, &prepared);
  std::vector<std::int32_t> ids(static_cast<std::size_t>(options.width) * options.height,
                                raster::kNoFace);
  raster::VisibilityRef<T>(prepared.mesh, rows.begin, std::min(rows.end, options.height), ids);
  for (std::int32_t& id : ids) {
    if (id >= 0) id = prepared.mesh.source_face[static_cast<std::size_t>(id)];
  }
  return ids;
}

// A scene prepared for shading: its streams packed at the corners of its faces, normals derived,
// lights with unit directions.
template <class T>
struct RefScene {
  const SceneT<T>* scene;
  VaryingSet set;                             // of `packed`, at corners
  std::vector<shade::UnitVector<T>> normals;  // derived: [V] or [F]
  std::vector<T> packed;                      // [F,3,C]
  PreparedScene<T> prepared;                  // with `packed` as attributes
  std::vector<shade::PyramidRef<T>> pyramids;
  ShadeUniforms<T> uniforms;
  std::vector<T> inverse_lengths;  // of the lights' directions
};

// The row of corner `i` of the faces in a stream's array or its gradient.
template <class T>
std::size_t StreamRow(const SceneT<T>& scene, Rate rate, std::size_t i) {
  return rate == Rate::kCorner ? i : static_cast<std::size_t>(scene.faces[i]);
}

template <class T>
std::size_t RefNormalRow(const SceneT<T>& scene, std::size_t corner) {
  return scene.shading.normals == Normals::kFlat ? corner / 3
                                                 : static_cast<std::size_t>(scene.faces[corner]);
}

template <class T>
void PackRef(RefScene<T>* s) {
  const SceneT<T>& scene = *s->scene;
  s->set.rate = Rate::kCorner;
  s->set.user_channels = scene.channels;
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    s->set[stream.what] = !stream.values.empty();
  });
  s->set[Varying::kNormal] = s->set[Varying::kPosition] = s->set[Varying::kUser] = true;
  const auto channels = static_cast<std::size_t>(s->set.channels());
  s->packed.assign(scene.faces.size() * channels, T(0));
  ForEachStream(scene, {}, [&](const SceneStream<T>& stream) {
    if (stream.what == Varying::kNormal && scene.shading.normals != Normals::kGiven) return;
    const auto width = static_cast<std::size_t>(s->set.width(stream.what));
    const T scale = T(StreamScale(scene, stream.what));
    for (std::size_t i = 0; i < scene.faces.size(); ++i) {
      for (std::size_t c = 0; c < width && !stream.values.empty(); ++c) {
        s->packed[i * channels + static_cast<std::size_t>(s->set.first(stream.what)) + c] =
            scale * stream.values[StreamRow(scene, stream.rate, i) * width + c];
      }
    }
  });
  if (scene.shading.normals == Normals::kGiven) return;
  const auto first = static_cast<std::size_t>(s->set.first(Varying::kNormal));
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    const auto& unit = s->normals[RefNormalRow(scene, i)].unit;
    std::copy(unit.begin(), unit.end(),
              s->packed.begin() + static_cast<std::ptrdiff_t>(i * channels + first));
  }
}

template <class T>
void SetUniformsRef(RefScene<T>* s) {
  const SceneT<T>& scene = *s->scene;
  ShadeUniforms<T>& u = s->uniforms;
  u.surfaces.assign(scene.surfaces.begin(), scene.surfaces.end());
  if (u.surfaces.empty()) u.surfaces.resize(1);
  if (scene.surfaces.empty()) u.surfaces[0].texture = scene.textures.empty() ? -1 : 0;
  for (const auto& light : scene.lights) {
    const auto unit = shade::NormalizeScaledRef(light.direction);
    u.lights.push_back({unit.unit, light.intensity});
    s->inverse_lengths.push_back(unit.inverse_length);
  }
  if (scene.shading.lighting == Lighting::kSphericalHarmonics) {
    u.sh = shade::ShPolynomialOf<T>(scene.sh);
  }
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      u.eye[c] -= scene.camera.rotation[3 * r + c] * scene.camera.translation[r];
    }
  }
  for (const auto& texture : scene.textures) s->pyramids.emplace_back(shade::ViewOf(texture));
}

template <class T>
void PrepareRefScene(const SceneT<T>& scene, const RenderOptions& options, RefScene<T>* s) {
  s->scene = &scene;
  const shade::TriangleMeshT<T> mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) {
    s->normals.resize(scene.positions.size() / 3);
    shade::SmoothNormalsRef<T>(mesh, s->normals);
  } else if (scene.shading.normals == Normals::kFlat) {
    s->normals.resize(scene.faces.size() / 3);
    shade::FlatNormalsRef<T>(mesh, s->normals);
  }
  PackRef(s);
  SetUniformsRef(s);
  PrepareRef(scene, {s->packed, s->set.channels(), Rate::kCorner}, options, &s->prepared);
}

// A foreground pixel: its position, and the interpolated values.
template <class T>
struct RefPixel {
  std::size_t face, index;  // face of the prepared mesh; pixel of the image
  T px, py;
  raster::FacePlane<T> plane;
  raster::PixelWeights<T> weights;
  std::vector<T> values;
};

template <class T>
RefPixel<T> InterpolatePixelRef(const RefScene<T>& s, const RenderOptions& options, int j, int i,
                                std::int32_t face) {
  RefPixel<T> out;
  out.face = static_cast<std::size_t>(face);
  out.index = static_cast<std::size_t>(i) * static_cast<std::size_t>(options.width) +
              static_cast<std::size_t>(j);
  out.px = T(j) + T(0.5);
  out.py = T(i) + T(0.5);
  out.plane = raster::MakeFacePlane(s.prepared.mesh, out.face);
  out.weights = raster::PixelWeightsRef(s.prepared.mesh, out.plane, out.face, options.interpolation,
                                        out.px, out.py);
  out.values.resize(static_cast<std::size_t>(s.set.channels()));
  raster::InterpolateRef<T>(s.prepared.mesh, s.prepared.attributes, out.face, out.weights,
                            out.values);
  return out;
}

template <class T>
ShadePixel<T> ShadePixelOf(const RefScene<T>& s, const RenderOptions& options,
                           const RefPixel<T>& at) {
  ShadePixel<T> p;
  ForEachPixelPart(p, [&](Varying what, std::span<T> part) {
    if (s.set[what]) std::copy_n(at.values.begin() + s.set.first(what), part.size(), part.begin());
  });
  const auto& mesh = s.prepared.mesh;
  const auto source = static_cast<std::size_t>(mesh.source_face[at.face]);
  const auto& surfaces = s.scene->face_surfaces;
  p.surface = surfaces.empty() ? 0 : static_cast<std::size_t>(surfaces[source]);
  if (s.scene->shading.two_sided) {
    const auto c = raster::CornersOf(mesh, at.face);
    const T area = (c.x[1] - c.x[0]) * (c.y[2] - c.y[0]) - (c.x[2] - c.x[0]) * (c.y[1] - c.y[0]);
    p.side = RealPart(area) <= 0 ? 1.0f : -1.0f;
  }
  const int texture = s.uniforms.surfaces[p.surface].texture;
  if (texture < 0) return p;
  const auto& view = s.pyramids[static_cast<std::size_t>(texture)].texture;
  const double uv[2] = {static_cast<double>(RealPart(p.uv[0])),
                        static_cast<double>(RealPart(p.uv[1]))};
  const int size[2] = {view.width, view.height};
  const UvPlanes planes = UvPlanesOf(mesh, s.prepared.attributes, s.set.first(Varying::kUv),
                                     at.face, options.interpolation);
  p.level = UvLevel<decltype(p.level)>(planes, RealPart(at.px), RealPart(at.py), uv, size);
  return p;
}

// Calls visit(index, column, row, face id) for each pixel of some rows.
template <class Visit>
void ForEachRowPixel(const RenderOptions& options, std::span<const std::int32_t> face_ids,
                     RowRange rows, const Visit& visit) {
  for (int i = rows.begin; i < std::min(rows.end, options.height); ++i) {
    for (int j = 0; j < options.width; ++j) {
      const auto index = static_cast<std::size_t>(i) * static_cast<std::size_t>(options.width) +
                         static_cast<std::size_t>(j);
      visit(index, j, i, face_ids[index]);
    }
  }
}

// Calls visit(pixel) for each foreground pixel.
template <class T, class Visit>
void ForEachPixelRef(const RefScene<T>& s, const RenderOptions& options,
                     std::span<const std::int32_t> face_ids, RowRange rows, const Visit& visit) {
  ForEachRowPixel(options, face_ids, rows, [&](std::size_t, int j, int i, std::int32_t id) {
    const std::int32_t face = raster::PieceAt(s.prepared.mesh, id, j, i);
    if (face != raster::kNoFace) visit(InterpolatePixelRef(s, options, j, i, face));
  });
}

template <class T>
void ShadePixelIntoFrame(const RefScene<T>& s, const RenderOptions& options, const RefPixel<T>& at,
                         FrameImagesT<T>* frame) {
  const ShadePixel<T> p = ShadePixelOf(s, options, at);
  const PixelValues<T> v = PixelShaderRef<T>(s.scene->shading, s.uniforms, s.pyramids).Forward(p);
  const raster::ScreenMeshT<T>& mesh = s.prepared.mesh;
  const std::size_t plane = frame->face_ids.size();
  const auto write = [&](AlignedVector<T>& image, std::span<const T> values) {
    for (std::size_t c = 0; c < values.size() && !image.empty(); ++c) {
      image[c * plane + at.index] = values[c];
    }
  };
  write(frame->color, v.color);
  write(frame->normals, v.normal.unit);
  write(frame->uv, p.uv);
  const auto user = static_cast<std::size_t>(s.set.first(Varying::kUser));
  write(frame->attributes, std::span<const T>(at.values).subspan(user));
  T source[3];
  raster::SourceWeights<T>(mesh, s.scene->faces, at.face, at.weights.w, source);
  write(frame->barycentrics, std::span<const T>(source).subspan(1));
  if (frame->depth.empty()) return;
  frame->depth[at.index] = T(1) / raster::MakeDepthPlane(mesh, at.face).At(at.px, at.py);
}

// All images in `request`, with visibility given as ids of the scene's faces [H,W]; only for some
// rows, the others are background of alpha 0.
template <class T>
void ReferenceRender(const SceneT<T>& scene, const RenderOptions& options, const Outputs& request,
                     std::span<const std::int32_t> face_ids, FrameImagesT<T>* frame,
                     RowRange rows = kAllRows) {
  RefScene<T> s;
  PrepareRefScene(scene, options, &s);
  SizeFrame(1, scene.channels, options, request, frame);
  frame->face_ids.assign(face_ids.begin(), face_ids.end());
  ForEachOutput(
      0,
      [](const char*, int, AlignedVector<T>& image) {
        std::fill(image.begin(), image.end(), T(0));
      },
      *frame);
  std::fill(frame->depth.begin(), frame->depth.end(), T(std::numeric_limits<double>::infinity()));
  ForEachPixelRef(s, options, face_ids, rows,
                  [&](const RefPixel<T>& at) { ShadePixelIntoFrame(s, options, at, frame); });
  if (!request.alpha) return;
  ForEachRowPixel(options, face_ids, rows, [&](std::size_t index, int j, int i, std::int32_t id) {
    const T px = T(j) + T(0.5), py = T(i) + T(0.5);
    frame->alpha[index] = id >= 0 ? T(1) : BackgroundAlphaRef(s.prepared, options, px, py);
  });
}

// Gradients of a scene before they are propagated to its arrays.
template <class T>
struct RefGradients {
  PreparedGradients<T> prepared;
  ShadeUniforms<T> uniforms;
  shade::Vec3<T> depth_axis = {};
  T depth_shift = T(0);

  explicit RefGradients(const RefScene<T>& s) : prepared(s.prepared) {
    uniforms.surfaces.resize(s.uniforms.surfaces.size());
    for (auto& surface : uniforms.surfaces) {
      surface.base_color = surface.ambient = surface.diffuse = surface.specular = {};
      surface.shininess = T(0);
    }
    uniforms.lights.resize(s.uniforms.lights.size(), shade::kNoLight<T>);
    for (const auto& pyramid : s.pyramids) {
      uniforms.texels.emplace_back(pyramid.texels.size(), T(0));
    }
  }
};

// Adds the adjoint of one foreground pixel.
template <class T>
void ShadePixelBackward(const RefScene<T>& s, const RenderOptions& options,
                        const FrameGradientsT<T>& d_frame, const RefPixel<T>& at,
                        RefGradients<T>* d) {
  const std::size_t plane =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  const auto read = [&](std::span<const T> image, std::span<T> out) {
    for (std::size_t c = 0; c < out.size(); ++c) {
      out[c] = image.empty() ? T(0) : image[c * plane + at.index];
    }
  };
  std::vector<T> d_values(at.values.size(), T(0));
  read(d_frame.attributes,
       std::span(d_values).subspan(static_cast<std::size_t>(s.set.first(Varying::kUser))));
  shade::Vec3<T> d_color, d_normal;
  std::array<T, 2> d_uv;
  std::array<T, 1> d_depth;
  read(d_frame.color, d_color);
  read(d_frame.normals, d_normal);
  read(d_frame.uv, d_uv);
  read(d_frame.depth, d_depth);
  const ShadePixel<T> p = ShadePixelOf(s, options, at);
  ShadePixel<T> d_p;
  ForEachPixelPart(d_p, [](Varying, std::span<T> part) { std::ranges::fill(part, T(0)); });
  d_p.uv = d_uv;
  PixelShaderRef<T>(s.scene->shading, s.uniforms, s.pyramids)
      .Backward(p, d_color, d_normal, &d_p, &d->uniforms);
  for (std::size_t c = 0; c < 3; ++c) {
    d_p.position[c] -= s.scene->camera.rotation[6 + c] * d_depth[0];
    d->depth_axis[c] -= p.position[c] * d_depth[0];
  }
  d->depth_shift -= d_depth[0];
  ForEachPixelPart(d_p, [&](Varying what, std::span<T> part) {
    const auto first = static_cast<std::size_t>(s.set.first(what));
    for (std::size_t c = 0; c < part.size() && s.set[what]; ++c) d_values[first + c] += part[c];
  });
  raster::InterpolateRefBackward<T>(s.prepared.mesh, s.prepared.attributes, at.plane, at.face,
                                    options.interpolation, at.weights, d_values, d->prepared.screen,
                                    d->prepared.attributes);
}

// From packed attributes to the scene's arrays; completes d_positions.
template <class T>
void UnpackRef(const RefScene<T>& s, std::span<const T> d_packed, std::span<T> d_positions,
               const SceneGradientsT<T>& d_scene) {
  const SceneT<T>& scene = *s.scene;
  const auto channels = static_cast<std::size_t>(s.set.channels());
  SceneGradientsT<T> d = d_scene;
  d.positions = d_positions;
  ForEachStream(scene, d, [&](const SceneStream<T>& stream) {
    const std::span<T> out = stream.gradient;
    if (stream.what != Varying::kPosition) std::fill(out.begin(), out.end(), T(0));
    if (stream.what == Varying::kNormal && scene.shading.normals != Normals::kGiven) return;
    const auto width = static_cast<std::size_t>(s.set.width(stream.what));
    const T scale = T(StreamScale(scene, stream.what));
    for (std::size_t i = 0; i < scene.faces.size() && !out.empty(); ++i) {
      for (std::size_t c = 0; c < width; ++c) {
        out[StreamRow(scene, stream.rate, i) * width + c] +=
            scale * d_packed[i * channels + static_cast<std::size_t>(s.set.first(stream.what)) + c];
      }
    }
  });
  if (scene.shading.normals == Normals::kGiven) return;
  std::vector<shade::Vec3<T>> d_units(s.normals.size());
  const auto first = static_cast<std::size_t>(s.set.first(Varying::kNormal));
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      d_units[RefNormalRow(scene, i)][c] += d_packed[i * channels + first + c];
    }
  }
  const shade::TriangleMeshT<T> mesh{scene.positions, scene.faces};
  if (scene.shading.normals == Normals::kSmooth) {
    shade::SmoothNormalsAdjointRef<T>(mesh, s.normals, d_units, d_positions);
  } else {
    shade::FlatNormalsAdjointRef<T>(mesh, s.normals, d_units, d_positions);
  }
}

template <class T>
void UniformsBackRef(const RefScene<T>& s, const RefGradients<T>& d,
                     const SceneGradientsT<T>& d_scene) {
  const ShadeUniforms<T>& u = d.uniforms;
  std::copy_n(u.surfaces.begin(), d_scene.surfaces.size(), d_scene.surfaces.begin());
  for (std::size_t k = 0; k < d_scene.lights.size(); ++k) {
    d_scene.lights[k] = {{}, u.lights[k].intensity};
    shade::NormalizeAdjointRef<T>({s.uniforms.lights[k].direction, s.inverse_lengths[k]},
                                  u.lights[k].direction, d_scene.lights[k].direction);
  }
  std::fill(d_scene.sh.begin(), d_scene.sh.end(), T(0));
  if (!d_scene.sh.empty()) {
    shade::ShPolynomialAdjoint<T>(u.sh, d_scene.sh);
  }
  for (std::size_t t = 0; t < d_scene.textures.size(); ++t) {
    std::vector<T> texels = u.texels[t];
    s.pyramids[t].Fold(texels);
    std::copy_n(texels.begin(), d_scene.textures[t].size(), d_scene.textures[t].begin());
  }
  CameraT<T>* const d_camera = d_scene.camera;
  if (d_camera == nullptr) return;
  const CameraT<T>& camera = s.scene->camera;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      d_camera->rotation[3 * r + c] -= camera.translation[r] * u.eye[c];
      d_camera->translation[r] -= camera.rotation[3 * r + c] * u.eye[c];
    }
    d_camera->rotation[6 + r] += d.depth_axis[r];
  }
  d_camera->translation[2] += d.depth_shift;
}

// Like RendererT::Backward, for one image or some of its rows.
template <class T>
void ReferenceRenderBackward(const SceneT<T>& scene, const RenderOptions& options,
                             std::span<const std::int32_t> face_ids,
                             const FrameGradientsT<T>& d_frame, const SceneGradientsT<T>& d_scene,
                             RowRange rows = kAllRows) {
  RefScene<T> s;
  PrepareRefScene(scene, options, &s);
  RefGradients<T> d(s);
  ForEachPixelRef(s, options, face_ids, rows,
                  [&](const RefPixel<T>& at) { ShadePixelBackward(s, options, d_frame, at, &d); });
  ForEachRowPixel(options, face_ids, rows, [&](std::size_t index, int j, int i, std::int32_t id) {
    if (id >= 0 || d_frame.alpha.empty()) return;
    const T px = T(j) + T(0.5), py = T(i) + T(0.5);
    BackgroundAlphaRefBackward(s.prepared, options, px, py, d_frame.alpha[index], &d.prepared);
  });
  MeshGradients<T> mesh = PrepareRefBackward(options, s.prepared, d.prepared);
  if (d_scene.camera != nullptr) *d_scene.camera = mesh.camera;
  UnpackRef<T>(s, mesh.attributes, mesh.positions, d_scene);
  std::copy_n(mesh.positions.begin(), d_scene.positions.size(), d_scene.positions.begin());
  UniformsBackRef(s, d, d_scene);
}

}  // namespace tilegrad
