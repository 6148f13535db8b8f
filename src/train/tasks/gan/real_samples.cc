// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/real_samples.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/clocks.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/rng.h"
#include "scene/shrink_image.h"
#include "train/predictor.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {
namespace {

// Width and height, in pixels, of the bounding box of pixels that are at least half covered.
template <class T>
std::array<double, 2> BoxOf(std::span<const T> plane, std::size_t side) {
  std::size_t left = side, right = 0, top = side, bottom = 0;
  for (std::size_t i = 0; i < plane.size(); ++i) {
    if (plane[i] < T(0.5)) continue;
    left = std::min(left, i % side);
    right = std::max(right, i % side + 1);
    top = std::min(top, i / side);
    bottom = std::max(bottom, i / side + 1);
  }
  if (right == 0) return {1, 1};
  return {static_cast<double>(right - left), static_cast<double>(bottom - top)};
}

constexpr std::uint64_t kPictureStream = 0x62616e6b, kDrawStream = 0x6d617073;

// The part of a texture that a map has, planar.
void AppendMap(const ImageU8& texture, const GeneratorConfig& maps,
               std::vector<std::uint8_t>* bytes) {
  const auto first = static_cast<int>(ShapeTextureGenerator::FirstColumn(maps));
  const auto width = static_cast<int>(ShapeTextureGenerator::MapWidth(maps));
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < texture.height; ++y) {
      for (int x = first; x < first + width; ++x) bytes->push_back(texture.at(x, y)[c]);
    }
  }
}

class Extraction {
 public:
  Extraction(const TextureBank::Job& job, const TextureBank::Data& data, TexturedModel& model,
             const Workers& workers)
      : job_(job),
        model_(model),
        stream_({StreamOf(job, model), model.config().light, data.dataset.info().camera,
                 data.dataset.info().image_size, job.seed ^ kPictureStream},
                data.meshes, workers),
        models_(data.meshes.size()) {}

  Status Append(std::size_t begin, std::size_t end, std::vector<std::uint8_t>* bytes) {
    std::vector<std::uint8_t> pictures;
    TexturedView view;
    for (std::size_t i = begin; i < end; ++i) {
      TILEGRAD_ASSIGN(const auto rgba,
                      stream_.Render(static_cast<int>(i % models_), i, 0, {&view, 1}));
      const auto picture = ToBytes(rgba);
      pictures.insert(pictures.end(), picture.begin(), picture.end());
    }
    TILEGRAD_ASSIGN(const auto objects, model_.PredictObjects(pictures));
    for (const PredictedObject& object : objects) {
      const ImageU8& texture = object.mesh.textures[0].image;
      const auto size = static_cast<int>(job_.maps.texture_size);
      if (texture.width % size != 0)
        return InvalidArgument(
            "its textures are {} texels a side; network.texture_size = {} does not divide that",
            texture.width, size);
      AppendMap(ShrunkImage(texture, size), job_.maps, bytes);
    }
    return {};
  }

 private:
  // The cameras that the network knows.
  static TexturedStreamConfig StreamOf(const TextureBank::Job& job, const TexturedModel& model) {
    TexturedStreamConfig out = model.config().stream;
    out.draw.stretch = job.stream.draw.stretch;
    out.draw.taper = job.stream.draw.taper;
    out.draw.recolor = job.stream.draw.recolor;
    out.draw.brightness = job.stream.draw.brightness;
    out.mirrored = job.stream.mirrored;
    return out;
  }

  const TextureBank::Job& job_;
  TexturedModel& model_;
  TexturedStream stream_;
  std::size_t models_;
};

Result<TexturedModel*> TexturedModelOf(const Predictor& predictor, const Dataset& dataset) {
  auto* const model = predictor.model().textured();
  if (model == nullptr)
    return InvalidArgument("it extracts no textures: train one with --config texture_quick");
  TILEGRAD_TRY(predictor.CheckImageSize(dataset));
  return model;
}

}  // namespace

std::vector<Camera> PrimaryCameras(const CameraRule& rule, std::int64_t count) {
  // Azimuth and elevation, degrees: objects face +z, which is 90.
  constexpr double kDirections[kMostViews][2] = {{90, 15}, {0, 10},  {270, 15},
                                                 {90, 80}, {50, 25}, {310, 25}};
  std::vector<Camera> out;
  for (std::int64_t v = 0; v < count; ++v)
    out.push_back(OrbitCamera(rule.lens, kDirections[v][0], kDirections[v][1], rule.distance));
  return out;
}

std::array<double, 3> MeanHalfAxes(const ObjectViews& views, const CameraRule& rule) {
  constexpr double kInside = 0.9;  // of the box: shapes grow rather than shrink
  const nn::Shape& shape = views.cover.shape();
  std::array<double, 2> front = {}, side = {};
  nn::WithFloatType(views.cover.dtype(), [&]<class T>(T) {
    const auto plane = static_cast<std::size_t>(shape[2] * shape[3]);
    const auto of = [&](std::int64_t object, std::int64_t view) {
      const auto at = static_cast<std::size_t>(object * shape[1] + view) * plane;
      return BoxOf(views.cover.span<T>().subspan(at, plane), static_cast<std::size_t>(shape[3]));
    };
    for (std::int64_t i = 0; i < shape[0]; ++i) {
      const auto f = of(i, 0), s = of(i, std::min<std::int64_t>(1, shape[1] - 1));
      for (std::size_t k = 0; k < 2; ++k) {
        front[k] += f[k] / static_cast<double>(shape[0]);
        side[k] += s[k] / static_cast<double>(shape[0]);
      }
    }
  });
  const double world =
      kInside * rule.distance / static_cast<double>(PrimaryCameras(rule, 1)[0].fy) / 2;
  return {world * front[0], world * side[1], world * side[0]};
}

// A batch under construction.
struct RealPictures::Drawing {
  RealPictures& pictures;
  std::vector<Sample> models;
  std::uint64_t first;  // position in the run
  ObjectViews out;
  std::vector<Status> failures = std::vector<Status>(models.size());

  void Run(std::size_t b, std::size_t lane) {
    const double start = ThreadSeconds();
    const auto rgba = pictures.DrawOne(models[b].model, first + b, lane);
    pictures.seconds_ += ThreadSeconds() - start;
    failures[b] = rgba.status();
    if (rgba.ok()) nn::WithFloatType(out.colors.dtype(), [&]<class T>(T) { Place<T>(*rgba, b); });
  }
  template <class T>
  void Place(std::span<const float> rgba, std::size_t b) {
    const std::size_t views = pictures.views_.size(), plane = rgba.size() / views / 4;
    for (std::size_t v = 0; v < views; ++v) {
      const auto view = rgba.subspan(4 * plane * v, 4 * plane);
      const std::size_t at = b * views + v;
      std::copy_n(view.begin(), 3 * plane, out.colors.data<T>() + 3 * plane * at);
      std::copy_n(view.begin() + static_cast<std::ptrdiff_t>(3 * plane), plane,
                  out.cover.data<T>() + plane * at);
    }
  }
  Result<ObjectViews> Finish() {
    for (const Status& failure : failures) TILEGRAD_TRY(failure);
    return std::move(out);
  }
};

RealPictures::RealPictures(nn::Context& context, const Job& job, MeshCache meshes)
    : context_(context),
      job_(job),
      stream_({job.config, NoLight(), job.camera, job.size, job.seed}, meshes,
              SideLoop::LanesOf(context.workers())),
      order_(static_cast<int>(meshes.size()), 1, job.seed),
      next_(context) {
  for (const Camera& camera : PrimaryCameras(job.camera, job.views)) views_.push_back({camera, {}});
}

BatchWork<ObjectViews> RealPictures::Work(const Batch& batch) {
  const auto models = order_.Batch(static_cast<std::int64_t>(batch.number), batch.count, 1);
  stream_.Expect(order_.Batch(static_cast<std::int64_t>(batch.number) + 1, batch.count, 1));
  const std::int64_t size = job_.size;
  const auto work =
      std::make_shared<Drawing>(Drawing{*this,
                                        models,
                                        batch.number * static_cast<std::uint64_t>(batch.count),
                                        {context_.Empty({batch.count, 3 * job_.views, size, size}),
                                         context_.Empty({batch.count, job_.views, size, size})}});
  return {models.size(), [work](std::size_t b, std::size_t lane) { work->Run(b, lane); },
          [work] { return work->Finish(); }};
}

Result<ObjectViews> RealPictures::Draw(const Batch& batch) {
  return MakeNow(Work(batch), context_);
}

Result<std::span<const float>> RealPictures::DrawOne(int model, std::uint64_t position,
                                                     std::size_t lane) {
  TILEGRAD_TRY(stream_.SetUp(model, position, lane, views_));
  return stream_.Again(lane, Appearance::kTexture);
}

Result<TextureBank> TextureBank::Extract(const Job& job, const Data& data, const Workers& workers,
                                         const Watch& watch) {
  TextureBank out;
  out.seed_ = job.seed;
  out.rows_ = job.maps.texture_size;
  out.columns_ = ShapeTextureGenerator::MapWidth(job.maps);
  out.map_bytes_ = static_cast<std::size_t>(3 * out.rows_ * out.columns_);
  const std::string place = "textures.run = \"" + job.run.string() + "\"";
  auto predictor = Predictor::Load(job.run, workers);
  if (!predictor.ok()) return predictor.status().Within(place);
  const auto model = TexturedModelOf(*predictor, data.dataset);
  if (!model.ok()) return model.status().Within(place);
  Extraction extraction(job, data, **model, workers);
  const auto count = static_cast<std::size_t>(job.count);
  out.bytes_.reserve(count * out.map_bytes_);
  for (std::size_t at = 0; at < count; at += Model::kImagesAtOnce) {
    TILEGRAD_TRY(watch.At({"extracting textures", at, count, ""}, kNothingWritten));
    const std::size_t end = std::min(count, at + Model::kImagesAtOnce);
    const Status status = extraction.Append(at, end, &out.bytes_);
    if (!status.ok()) return status.Within(place);
  }
  return out;
}

nn::Tensor TextureBank::Draw(nn::Context& context, std::uint64_t number, int count) const {
  nn::Tensor maps = context.Empty({count, 3, rows_, columns_});
  Rng rng(seed_ ^ kDrawStream, number);
  nn::WithFloatType(context.dtype(), [&]<class T>(T) {
    T* to = maps.data<T>();
    for (int i = 0; i < count; ++i) {
      const std::uint8_t* from = bytes_.data() + rng.Below(size()) * map_bytes_;
      to = std::transform(from, from + map_bytes_, to,
                          [](std::uint8_t b) { return static_cast<T>(b) / T(255); });
    }
  });
  return maps;
}

std::string TextureBank::Fingerprint(const std::string& with) const {
  Hash both;
  both.Add(with);
  both.AddAll(bytes_);
  return both.Text();
}

std::vector<float> TextureBank::Mean() const {
  std::vector<double> sum(map_bytes_);
  for (std::size_t i = 0; i < bytes_.size(); ++i) sum[i % map_bytes_] += bytes_[i];
  std::vector<float> mean;
  for (const double x : sum)
    mean.push_back(static_cast<float>(x / 255 / static_cast<double>(size())));
  return mean;
}

}  // namespace tilegrad::train
