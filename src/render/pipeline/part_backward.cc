// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstring>

#include "base/array_checks.h"
#include "base/clocks.h"
#include "raster/conventions.h"
#include "raster/project.h"
#include "raster/visibility_ref.h"
#include "render/pipeline/stages.h"

namespace tilegrad {
namespace {

// Converts ids of the caller's faces to faces of a clipped screen mesh, in rows.
void FindPieces(const raster::ScreenMesh& mesh, int row_begin, std::span<const std::int32_t> ids,
                AlignedVector<std::int32_t>* faces) {
  faces->resize(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto width = static_cast<std::size_t>(mesh.width);
    (*faces)[i] = raster::PieceAt(mesh, ids[i], static_cast<int>(i % width),
                                  row_begin + static_cast<int>(i / width));
  }
}

// Position of a band in the batch.
struct BandPlace {
  int row_begin, row_end;
  std::size_t plane;         // pixels of an image
  std::size_t first, count;  // its pixels in an image
  std::size_t image;

  BandPlace(const BandGrid& bands, const BandTask& task)
      : row_begin(static_cast<int>(task.band) * bands.rows),
        row_end(std::min(row_begin + bands.rows, bands.height)),
        plane(static_cast<std::size_t>(bands.width) * static_cast<std::size_t>(bands.height)),
        first(static_cast<std::size_t>(row_begin) * static_cast<std::size_t>(bands.width)),
        count(static_cast<std::size_t>(row_end - row_begin) *
              static_cast<std::size_t>(bands.width)),
        image(task.image) {}

  // The band's pixels of plane c of an image of `planes` planes.
  template <class T>
  std::span<const T> Of(std::span<const T> batch, std::size_t planes, std::size_t c) const {
    return batch.subspan((image * planes + c) * plane + first, count);
  }
};

bool IsSoundBand(const BackwardInput& input, std::size_t channels, const BandPlace& place) {
  const PipelineCotangents& d_frame = input.d_frame;
  if (!d_frame.alpha.empty() && !AllFinite(place.Of(d_frame.alpha, 1, 0))) return false;
  for (std::size_t c = 0; c < channels && !d_frame.attributes.empty(); ++c) {
    if (!AllFinite(place.Of(d_frame.attributes, channels, c))) return false;
  }
  return true;
}

// Pixels [x0, x0 + columns) of the rows of a band, whose faces are `faces` [rows][width of image].
struct StripPlace {
  const BandPlace& band;
  std::span<const std::int32_t> faces;
  int width, x0;

  int columns() const { return std::min(raster::kBinSize, width - x0); }
  int row_count() const { return band.row_end - band.row_begin; }
};

// Gathers the faces of a strip, in rows of kBinSize. Returns whether there are any.
bool GatherStripFaces(const StripPlace& strip, AlignedVector<std::int32_t>* faces) {
  faces->assign(static_cast<std::size_t>(raster::kBinSize * strip.row_count()), raster::kNoFace);
  std::int32_t all = raster::kNoFace;
  for (int i = 0; i < strip.row_count(); ++i) {
    const std::int32_t* from =
        strip.faces.data() + static_cast<std::ptrdiff_t>(i) * strip.width + strip.x0;
    std::int32_t* to = faces->data() + static_cast<std::ptrdiff_t>(i) * raster::kBinSize;
    for (int j = 0; j < strip.columns(); ++j) {
      to[j] = from[j];
      all &= from[j];
    }
  }
  return all != raster::kNoFace;
}

void RunStageBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                      const StripPlace& place, WorkerScratch* worker) {
  if (!GatherStripFaces(place, &worker->strip_faces)) return;
  const PixelStrip strip{.image = task.image,
                         .band = task.band,
                         .worker = worker->index,
                         .mesh = &image.mesh,
                         .attributes = image.recomputed,
                         .rows = {worker->strip_faces.data(), raster::kBinSize, place.x0,
                                  place.band.row_begin, place.band.row_end},
                         .columns = place.columns(),
                         .first = place.band.first + static_cast<std::size_t>(place.x0),
                         .varyings = worker->varyings.data(),
                         .any_face = true};
  StageClock clock;
  if (image.recomputed.channels > 0) {
    raster::Interpolate(
        {&image.mesh, image.recomputed, input.options.interpolation, false}, strip.rows,
        {{worker->varyings.data(), static_cast<std::ptrdiff_t>(strip.plane()), raster::kBinSize},
         {},
         strip.columns},
        &worker->interpolate);
  }
  clock.Lap(&worker->times.interpolate);
  float* const d_varyings =
      image.attributes.channels > 0 ? worker->d_varyings.data() + place.x0 : nullptr;
  input.stage->Backward(strip,
                        {d_varyings, static_cast<std::ptrdiff_t>(place.band.count), place.width});
  clock.Lap(&worker->times.stage);
}

// The cotangents of a band's attributes, from the stage. False: a number is not finite.
bool BandCotangents(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                    const BandPlace& place, std::span<const std::int32_t> faces,
                    WorkerScratch* worker) {
  if (!input.stage->BeginBand(task.image, task.band, place.first, place.count)) return false;
  const auto grow = [](std::size_t size, AlignedVector<float>* array) {
    if (array->size() < size) array->resize(size);
  };
  const auto rows = static_cast<std::size_t>(place.row_end - place.row_begin);
  grow(static_cast<std::size_t>(image.recomputed.channels) * rows * raster::kBinSize,
       &worker->varyings);
  grow(static_cast<std::size_t>(image.attributes.channels) * place.count, &worker->d_varyings);
  for (int x0 = 0; x0 < input.options.width; x0 += raster::kBinSize) {
    RunStageBackward(input, image, task, {place, faces, input.options.width, x0}, worker);
  }
  return true;
}

// Gradients of a band's faces from the cotangents of its pixels' attributes.
void SumBandFaces(const BackwardInput& input, const ImageScratch& image,
                  const raster::BackwardBand& band, const raster::BackwardRequest& request,
                  raster::BandSums* sums, BandGradients* out) {
  const raster::InterpolateInput interpolate{&image.mesh, image.attributes,
                                             input.options.interpolation, false};
  raster::SumBand(interpolate, band, sums);
  if (sums->faces() == 0) return;
  out->stride = sums->stride();
  out->faces.assign(sums->face.data() + 1, sums->face.data() + sums->count);
  const std::size_t arrays = raster::FaceGradientArrays(image.attributes.channels, request);
  const std::size_t numbers = 4 * arrays * out->stride;
  if (out->values.size() < numbers) out->values.resize(numbers);
  raster::FinishBand(interpolate, *sums, request, out->values);
}

// Loads everything before storing anything, so that compilers see one vector.
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

// Adds to `d_rows` [row][group][4] of the attributes' rows.
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

// [row][channels] <- [row][group][4]: copies whole quads as long as the next one overwrites the
// excess of each.
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

// Attributes of a clipped mesh; d_clip_t is needed whenever geometry is.
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

bool RenderBandBackward(const BackwardInput& input, const ImageScratch& image, const BandTask& task,
                        const raster::BackwardRequest& request, WorkerScratch* worker,
                        BandGradients* out) {
  const BandPlace place(BandGrid(input.options.width, input.options.height), task);
  const auto channels = static_cast<std::size_t>(image.attributes.channels);
  const bool staged = input.stage != nullptr, wanted = request.geometry || request.attributes;
  out->faces.clear();
  if (!IsSoundBand(input, channels, place)) return false;
  if (!staged && (input.d_frame.attributes.empty() || !wanted)) return true;
  ++worker->stats.interpolated;
  auto ids = place.Of(std::span<const std::int32_t>(input.frame.face_ids), 1, 0);
  if (image.mesh.was_clipped()) {
    FindPieces(image.mesh, place.row_begin, ids, &out->pieces);
    ids = out->pieces;
  }
  raster::PlanarView<const float> d_out{nullptr, static_cast<std::ptrdiff_t>(place.plane),
                                        input.options.width};
  if (staged) {
    if (!BandCotangents(input, image, task, place, ids, worker)) return false;
    if (channels == 0 || !wanted) return true;
    d_out.data = worker->d_varyings.data();
    d_out.plane = static_cast<std::ptrdiff_t>(place.count);
  } else {
    d_out.data = place.Of(input.d_frame.attributes, channels, 0).data();
  }
  StageClock clock;
  SumBandFaces(input, image,
               {{ids.data(), input.options.width, 0, place.row_begin, place.row_end}, d_out},
               request, &worker->band, out);
  clock.Lap(&worker->times.gradients);
  return true;
}

void RenderBinBackward(const BackwardInput& input, const ImageScratch& image, const BinTask& bin,
                       WorkerScratch* worker, BinGradients* out) {
  const raster::SquareGrid bins = raster::BinGrid(input.options.width, input.options.height);
  const std::size_t pixels =
      static_cast<std::size_t>(bins.width) * static_cast<std::size_t>(bins.height);
  const auto part = [&](auto batch) {
    return batch.empty() ? batch : batch.subspan(bin.image * pixels, pixels);
  };
  out->clear();
  ++worker->stats.alpha_parts;
  input.alpha->Backward(
      {image, bin, worker->index},
      {part(std::span<const std::int32_t>(input.frame.face_ids)),
       part(std::span<const float>(input.frame.alpha)),
       part(std::span<const float>(input.frame.transmittance)), part(input.d_frame.alpha)},
      out);
}

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
