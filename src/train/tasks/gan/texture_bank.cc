// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/gan/texture_bank.h"

#include <algorithm>

#include "base/error.h"
#include "base/hash.h"
#include "base/rng.h"
#include "train/predictor.h"
#include "train/tasks/textured_image/model.h"
#include "train/tasks/textured_image/object_pictures.h"

namespace tilegrad::train {
namespace {

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
      if (texture.width % size != 0) {
        return InvalidArgument(
            "its textures are {} texels a side; network.texture_size = {} does not divide that",
            texture.width, size);
      }
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

Result<TextureBank> TextureBank::Extract(const Job& job, const Data& data, const Workers& workers,
                                         const ProgressSink& progress, const StopFlag& stop) {
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
    if (stop) return Cancelled("stopped while extracting textures; nothing was written");
    const std::size_t end = std::min(count, at + Model::kImagesAtOnce);
    const Status status = extraction.Append(at, end, &out.bytes_);
    if (!status.ok()) return status.Within(place);
    if (progress) progress({"extracting textures", end, count, ""});
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
