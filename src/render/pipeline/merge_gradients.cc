// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "base/array_checks.h"
#include "raster/project.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// All is loaded before anything is stored, so that compilers see one vector.
void AddQuad(const float* from, float* to) {
  float sum[4];
  for (int i = 0; i < 4; ++i) sum[i] = to[i] + from[i];
  std::memcpy(to, sum, sizeof(sum));
}

// Calls add(face, slot in the band's arrays) for the faces of all bands.
template <class Add>
void ForEachBandFace(const BandGradients& band, const Add& add) {
  for (std::size_t i = 0; i < band.faces.size(); ++i) {
    add(static_cast<std::size_t>(band.faces[i]), i + 1);
  }
}

void AddBandGeometry(const raster::ScreenMesh& mesh, const BandGradients& band, float* d_vertices) {
  ForEachBandFace(band, [&](std::size_t face, std::size_t slot) {
    const float* from = band.values.data() + 4 * slot;
    for (int k = 0; k < 3; ++k, from += 4 * band.stride) {
      AddQuad(from, d_vertices + 4 * static_cast<std::size_t>(mesh.vertex(face, k)));
    }
  });
}

void AddBinGeometry(const raster::ScreenMesh& mesh, const BinGradients& bin, float* d_vertices) {
  for (const raster::SoftFaceGradient& g : bin) {
    for (int k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(mesh.vertex(static_cast<std::size_t>(g.face), k));
      float* to = d_vertices + 4 * v;
      const float sum[2] = {to[0] + g.d_corner[k][0], to[1] + g.d_corner[k][1]};
      std::memcpy(to, sum, sizeof(sum));
    }
  }
}

// `d_rows` [row][group][4] of the attributes' rows.
void AddBandAttributes(const ImageScratch& image, bool geometry, const BandGradients& band,
                       float* d_rows) {
  const std::size_t groups = raster::ChannelGroups(image.attributes.channels);
  const bool by_vertex = image.attributes.rate == Rate::kVertex;
  ForEachBandFace(band, [&](std::size_t face, std::size_t slot) {
    const float* from = band.values.data() + 4 * slot + (geometry ? 12 * band.stride : 0);
    for (std::size_t g = 0; g < groups; ++g) {
      for (int k = 0; k < 3; ++k, from += 4 * band.stride) {
        const std::size_t row = by_vertex ? static_cast<std::size_t>(image.mesh.vertex(face, k))
                                          : 3 * face + static_cast<std::size_t>(k);
        AddQuad(from, d_rows + 4 * (row * groups + g));
      }
    }
  });
}

// [row][channels] <- [row][group][4]: whole quads as long as what is too much of one is written
// over by the next.
void PackRows(const AlignedVector<float>& quads, std::size_t channels, std::span<float> rows) {
  const std::size_t groups = raster::ChannelGroups(static_cast<int>(channels));
  const float* from = quads.data();
  float* row = rows.data();
  float* const end = row + rows.size();
  const auto room = static_cast<std::ptrdiff_t>(3 * groups + 1);  // of the quads of a row
  for (; end - row >= room; row += channels) {
    for (std::size_t g = 0; g < groups; ++g, from += 4) {
      std::memcpy(row + 3 * g, from, 4 * sizeof(float));
    }
  }
  for (; row < end; row += channels) {
    for (std::size_t g = 0; g < groups; ++g, from += 4) {
      std::copy_n(from, std::min<std::ptrdiff_t>(4, end - (row + 3 * g)), row + 3 * g);
    }
  }
}

// Sums the bands' gradients of attributes into `d_attributes`, in the layout of the screen mesh.
void SumAttributes(const ImageScratch& image, const ImageGradients& gradients,
                   AlignedVector<float>* d_rows, std::span<float> d_attributes) {
  const auto channels = static_cast<std::size_t>(image.attributes.channels);
  if (channels == 0) return;
  const std::size_t groups = raster::ChannelGroups(image.attributes.channels);
  d_rows->assign(4 * groups * (d_attributes.size() / channels), 0.0f);
  for (const BandGradients& band : gradients.bands) {
    AddBandAttributes(image, gradients.request.geometry, band, d_rows->data());
  }
  PackRows(*d_rows, channels, d_attributes);
}

// Attributes of a mesh that was cut; d_clip_t is wanted wherever geometry is.
void MergeClippedAttributes(const PipelineScene& scene, const ImageScratch& image,
                            const ImageGradients& gradients, MergeScratch* scratch,
                            PipelineGradients* d_scene) {
  std::fill(d_scene->attributes.begin(), d_scene->attributes.end(), 0.0f);
  scratch->d_clip_t.assign(image.mesh.clipped.size(), 0.0f);
  scratch->d_attributes.resize(raster::AttributeRows(image.mesh, scene.attributes.rate) *
                               static_cast<std::size_t>(scene.attributes.channels));
  SumAttributes(image, gradients, &scratch->d_rows, scratch->d_attributes);
  raster::ClipAttributesBackward<float>(image.mesh, scene.mesh->faces, scene.attributes,
                                        scratch->d_attributes, d_scene->attributes,
                                        scratch->d_clip_t);
}

bool IsFiniteCamera(const Camera& camera) {
  const float numbers[4] = {camera.fx, camera.fy, camera.cx, camera.cy};
  return AllFinite(camera.rotation) && AllFinite(camera.translation) && AllFinite(numbers);
}

}  // namespace

void SumGeometry(const ImageScratch& image, const ImageGradients& gradients,
                 AlignedVector<float>* d_vertices) {
  d_vertices->assign(4 * image.mesh.vertices(), 0.0f);
  for (const BandGradients& band : gradients.bands) {
    AddBandGeometry(image.mesh, band, d_vertices->data());
  }
  for (const BinGradients& bin : gradients.bins) {
    AddBinGeometry(image.mesh, bin, d_vertices->data());
  }
}

bool MergeGeometry(const PipelineScene& scene, const RenderOptions& options,
                   const ImageScratch& image, const ImageGradients& gradients,
                   std::span<const float> d_vertices, WorkerScratch* worker,
                   PipelineGradients* d_scene) {
  MergeScratch* const scratch = &worker->merge;
  bool finite = true;
  if (image.mesh.was_clipped() && gradients.request.attributes) {
    MergeClippedAttributes(scene, image, gradients, scratch, d_scene);
    finite = AllFinite(d_scene->attributes);
    ++worker->stats.merged;
  }
  if (!gradients.request.geometry) return finite;
  ++worker->stats.merged;
  raster::ProjectBackward(FaceSourceOf(*scene.mesh, options), image.mesh,
                          {d_vertices, scratch->d_clip_t}, &scratch->project,
                          {d_scene->positions, d_scene->camera ? &d_scene->d_camera : nullptr});
  return finite && IsFiniteGeometry(*d_scene);
}

bool IsFiniteGeometry(const PipelineGradients& d_scene) {
  return AllFinite(d_scene.positions) && (!d_scene.camera || IsFiniteCamera(d_scene.d_camera));
}

bool MergeAttributes(const ImageScratch& image, const ImageGradients& gradients,
                     WorkerScratch* worker, PipelineGradients* d_scene) {
  if (d_scene->attributes.empty() || image.mesh.was_clipped()) return true;
  ++worker->stats.merged;
  SumAttributes(image, gradients, &worker->merge.d_rows, d_scene->attributes);
  return AllFinite(d_scene->attributes);
}

}  // namespace tilegrad
