// SPDX-License-Identifier: Apache-2.0
#include "train/eval/training_pictures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "base/error.h"
#include "render/picture/composite.h"
#include "train/data/cutout.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kPixels = std::size_t{kThumbnailSize} * kThumbnailSize,
                      kPictureBytes = 4 * kPixels;

constexpr const char* kThumbnails = "thumbnails.npz";  // of a run

// Indices of at most `most` of `count` items, evenly spread.
std::vector<std::size_t> SpreadIndices(std::size_t count, std::size_t most) {
  const std::size_t taken = std::min(count, most);
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < taken; ++i) out.push_back(i * count / taken);
  return out;
}

// The distance of two framed pictures, [0, 1]: the mean over what either covers of the squared
// differences of colour and of coverage, with equal weight. May stop at a smaller value if that is
// at least `limit`.
double PictureDistance(const std::uint8_t* a, const std::uint8_t* b, double limit) {
  std::uint32_t color = 0, alpha = 0, covered = 0;  // at most 768 * 255^2
  for (std::size_t i = 3 * kPixels; i < kPictureBytes; ++i) {
    const int difference = int{a[i]} - int{b[i]};
    alpha += static_cast<std::uint32_t>(difference * difference);
    covered += std::max(a[i], b[i]);
  }
  if (covered == 0) return 0;
  double distance = 0;
  for (std::size_t i = 0; i < 3 * kPixels && distance < limit;) {
    for (const std::size_t end = i + kPixels / 4; i < end; ++i) {
      const int difference = int{a[i]} - int{b[i]};
      color += static_cast<std::uint32_t>(difference * difference);
    }
    distance = (color / 3.0 + alpha) / (2 * 255.0 * covered);
  }
  return distance;
}

// One line of a text.
std::string OneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return text;
}

}  // namespace

TrainingPictures TrainingPictures::Of(const Dataset& dataset, const ImageStore& store,
                                      const Workers& workers) {
  TrainingPictures out;
  std::map<std::pair<int, std::string>, int> shapes;  // numbered as they come
  std::vector<int> shape_of;
  for (const int m : dataset.Select(Split::kTrain)) {
    const ModelInfo& model = dataset.model(m);
    out.models_.push_back(
        {OneLine(model.name.empty() ? model.id : model.name), OneLine(dataset.ClassOf(model))});
    const int next = static_cast<int>(shapes.size());
    shape_of.push_back(shapes.try_emplace({model.class_index, ShapeOf(model)}, next).first->second);
  }
  out.Keep(store, workers);
  out.Measure(shape_of, workers);
  return out;
}

void TrainingPictures::Keep(const ImageStore& store, const Workers& workers) {
  count_ = std::int64_t{store.models} * store.views;
  const auto chosen = SpreadIndices(static_cast<std::size_t>(count_), kMostThumbnails);
  std::vector<std::vector<std::uint8_t>> small(chosen.size());
  const auto model_of = [&](std::size_t i) { return static_cast<int>(chosen[i]) / store.views; };
  workers.For(chosen.size(), [&](std::size_t i, std::size_t) {
    const auto image = store.Image(model_of(i), static_cast<int>(chosen[i]) % store.views);
    auto made = PrepareCutout(StraightRgba(image, store.size), kThumbnailSize, Framing::kFit);
    if (made.ok()) small[i] = std::move(*made);
  });
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (small[i].empty()) continue;
    pictures_.insert(pictures_.end(), small[i].begin(), small[i].end());
    of_.push_back(model_of(i));
  }
}

std::span<const std::uint8_t> TrainingPictures::Picture(std::size_t i) const {
  return std::span(pictures_).subspan(i * kPictureBytes, kPictureBytes);
}

template <class MayMatch>
std::optional<TrainingPictures::Found> TrainingPictures::Search(std::span<const std::uint8_t> small,
                                                                const MayMatch& may_match) const {
  std::optional<Found> best;
  for (std::size_t i = 0; i < of_.size(); ++i) {
    if (!may_match(i)) continue;
    const double limit = best ? best->square : HUGE_VAL;
    const double square = PictureDistance(small.data(), Picture(i).data(), limit);
    if (square < limit) best = Found{i, square};
  }
  return best;
}

void TrainingPictures::Measure(std::span<const int> shapes, const Workers& workers) {
  const auto shape = [&](std::size_t i) { return shapes[static_cast<std::size_t>(of_[i])]; };
  const auto measured = SpreadIndices(of_.size(), kMostMeasured);
  std::vector<std::optional<Found>> found(measured.size());
  workers.For(measured.size(), [&](std::size_t i, std::size_t) {
    const int own = shape(measured[i]);
    found[i] = Search(Picture(measured[i]), [&](std::size_t other) { return shape(other) != own; });
  });
  for (const auto& nearest : found) {
    if (nearest) others_.push_back(static_cast<float>(std::sqrt(nearest->square)));
  }
  std::sort(others_.begin(), others_.end());
}

std::optional<double> TrainingPictures::usual() const {
  if (others_.empty()) return std::nullopt;
  const double rank = std::ceil(kUsualShare * static_cast<double>(others_.size()));
  return others_[static_cast<std::size_t>(rank) - 1];
}

bool TrainingPictures::IsUnlike(const Match& match) const {
  const auto limit = usual();
  return limit && match.distance > *limit;
}

Result<std::optional<TrainingPictures::Match>> TrainingPictures::Nearest(
    const ImageU8& image) const {
  TILEGRAD_ASSIGN(const auto small, PrepareCutout(image, kThumbnailSize, Framing::kFit));
  const auto found = Search(small, [](std::size_t) { return true; });
  if (!found) return std::optional<Match>();
  const Model& model = models_[static_cast<std::size_t>(of_[found->picture])];
  return std::optional(Match{model.name, model.class_name, std::sqrt(found->square)});
}

Status TrainingPictures::Write(const Path& run) const {
  std::string names;
  for (const Model& model : models_) names += model.name + "\t" + model.class_name + "\n";
  const auto* text = reinterpret_cast<const std::uint8_t*>(names.data());
  const std::size_t kept = of_.size();
  return io::SaveNpz(run / kThumbnails,
                     {{"pictures", io::MakeNpy<std::uint8_t>(
                                       {kept, 4, kThumbnailSize, kThumbnailSize}, pictures_)},
                      {"models", io::MakeNpy<std::int32_t>({kept}, of_)},
                      {"names", io::MakeNpy<std::uint8_t>({names.size()}, {text, names.size()})},
                      {"others", io::MakeNpy<float>({others_.size()}, others_)},
                      {"count", io::MakeNpy<std::int64_t>({1}, {&count_, 1})}});
}

// Checks that the arrays of a file agree.
Status TrainingPictures::Check() const {
  if (pictures_.size() != of_.size() * kPictureBytes || of_.size() > kMostThumbnails)
    return DataLoss("{} bytes of {} pictures", pictures_.size(), of_.size());
  for (const std::int32_t model : of_) {
    if (model < 0 || static_cast<std::size_t>(model) >= models_.size())
      return DataLoss("a picture of model {}, of {}", model, models_.size());
  }
  for (const float distance : others_) {
    if (!(distance >= 0 && distance <= 1)) return DataLoss("a distance of {}", distance);
  }
  if (!std::is_sorted(others_.begin(), others_.end()))
    return DataLoss("distances are not in order");
  return {};
}

Status TrainingPictures::Load(const RunFile& file) {
  io::NpzArrays arrays;
  for (const char* name : {"pictures", "models", "names", "others", "count"}) {
    TILEGRAD_ASSIGN(arrays[name], io::DecodeNpzArray(file.bytes, file.place, name));
  }
  return Fill(arrays).Within(file.place);
}

Status TrainingPictures::Fill(const io::NpzArrays& arrays) {
  TILEGRAD_ASSIGN(pictures_, arrays.at("pictures").As<std::uint8_t>());
  TILEGRAD_ASSIGN(of_, arrays.at("models").As<std::int32_t>());
  TILEGRAD_ASSIGN(others_, arrays.at("others").As<float>());
  TILEGRAD_ASSIGN(const auto text, arrays.at("names").As<std::uint8_t>());
  TILEGRAD_ASSIGN(const auto count, arrays.at("count").As<std::int64_t>());
  if (count.size() != 1) return DataLoss("{} counts of pictures", count.size());
  count_ = count[0];
  std::istringstream lines(std::string(text.begin(), text.end()));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t tab = std::min(line.find('\t'), line.size());
    models_.push_back({line.substr(0, tab), line.substr(std::min(tab + 1, line.size()))});
  }
  return Check();
}

Result<std::optional<TrainingPictures>> TrainingPictures::Read(const Path& run) {
  TILEGRAD_ASSIGN(const auto file, ReadRunFile(run, kThumbnails));
  if (!file) return std::optional<TrainingPictures>();
  TrainingPictures out;
  TILEGRAD_TRY(out.Load(*file));
  return std::optional(std::move(out));
}

}  // namespace tilegrad::train
