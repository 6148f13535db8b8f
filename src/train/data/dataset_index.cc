// SPDX-License-Identifier: Apache-2.0
// The index files of a dataset: dataset.json, models.jsonl, rejected.jsonl.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "train/data/dataset_files.h"
#include "train/json_fields.h"

namespace tilegrad::train {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "tilegrad-dataset-1";
constexpr const char *kModelFolder = "models", *kModelEnding = ".npz";
constexpr double kMostUnits = 1e6;  // far beyond any dataset, and float still has digits
constexpr Split kSplits[] = {Split::kTrain, Split::kValidation, Split::kTest};

std::string Hex(std::uint64_t value) { return fmt::format("{:016x}", value); }

void ReadHex(JsonFields& fields, const char* key, std::uint64_t* out) {
  std::string text;
  fields.Read(key, &text);
  if (!fields.status().ok()) return;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out, 16);
  if (error != std::errc() || end != text.data() + text.size())
    fields.Fail(DataLoss("{}: \"{}\" must be a hexadecimal number", fields.place(), key));
}

// Ids and classes become file names.
void ReadFileName(JsonFields& fields, const char* key, std::string* out) {
  fields.Read(key, out);
  if (fields.status().ok() &&
      (out->empty() || *out == "." || *out == ".." || out->find('/') != std::string::npos)) {
    fields.Fail(DataLoss("{}: \"{}\" is not a file name", fields.place(), key));
  }
}

Json CameraJson(const DatasetInfo& info) {
  const CameraRule& rule = info.camera;
  Json json = {{"fov_y", rule.lens.fov_y},
               {"azimuth_step", rule.azimuth_step},
               {"elevation", rule.elevation},
               {"distance", rule.distance},
               {"half_extent", rule.half_extent}};
  if (info.own_cameras) json["own"] = true;
  return json;
}

Status ReadCamera(const nlohmann::json& json, const std::string& place, DatasetInfo* info) {
  CameraRule* const rule = &info->camera;
  JsonFields fields(json, place);
  info->own_cameras = json.is_object() && json.contains("own") && json["own"] == true;
  fields.Read("fov_y", &rule->lens.fov_y);
  fields.Read("azimuth_step", &rule->azimuth_step);
  fields.Read("elevation", &rule->elevation);
  fields.Read("distance", &rule->distance);
  fields.Read("half_extent", &rule->half_extent);
  rule->lens.width = rule->lens.height = info->image_size;
  TILEGRAD_TRY(fields.status());
  const CameraRule& r = *rule;
  if (!(r.lens.fov_y > 0 && r.lens.fov_y < 180))
    return DataLoss("{}: \"fov_y\" is {}; must be above 0 and below 180 degrees", place,
                    r.lens.fov_y);
  if (!(std::abs(r.elevation) <= 90))
    return DataLoss("{}: \"elevation\" is {}; must be -90 to 90 degrees", place, r.elevation);
  // A dataset's objects are half_extent large: of a camera at their centre nothing is seen.
  for (const auto& [key, value] :
       {std::pair("distance", r.distance), std::pair("half_extent", r.half_extent)}) {
    if (!(value > 0 && value <= kMostUnits))
      return DataLoss("{}: \"{}\" is {}; must be above 0 and at most {:g} world units", place, key,
                      value, kMostUnits);
  }
  if (!(std::abs(r.azimuth_step) <= kMostUnits))
    return DataLoss("{}: \"azimuth_step\" is {} degrees", place, r.azimuth_step);
  return {};
}

Json ModelJson(const DatasetInfo& info, const ModelInfo& model) {
  Json json = {{"id", model.id},
               {"class", info.classes[static_cast<std::size_t>(model.class_index)]},
               {"split", SplitName(model.split)},
               {"name", model.name},
               {"license", model.license},
               {"creator", model.creator},
               {"source_faces", model.source_faces},
               {"geometry", Hex(model.geometry)}};
  if (!model.shape.empty()) json["shape"] = model.shape;
  return json;
}

void ReadSplit(JsonFields& fields, Split* out) {
  std::string name;
  fields.Read("split", &name);
  const auto at = std::find_if(std::begin(kSplits), std::end(kSplits),
                               [&](Split split) { return name == SplitName(split); });
  if (at == std::end(kSplits))
    return fields.Fail(DataLoss("{}: \"split\" must be train, validation or test", fields.place()));
  *out = *at;
}

void ReadClass(JsonFields& fields, const DatasetInfo& info, int* out) {
  std::string name;
  fields.Read("class", &name);
  const auto at = std::find(info.classes.begin(), info.classes.end(), name);
  if (at == info.classes.end())
    return fields.Fail(
        DataLoss("{}: class \"{}\" is not listed in dataset.json", fields.place(), name));
  *out = static_cast<int>(at - info.classes.begin());
}

Result<ModelInfo> ReadModel(const nlohmann::json& json, const std::string& place,
                            const DatasetInfo& info) {
  JsonFields fields(json, place);
  ModelInfo model;
  ReadFileName(fields, "id", &model.id);
  fields.Read("name", &model.name);
  fields.Read("license", &model.license);
  fields.Read("creator", &model.creator);
  fields.Read("source_faces", 0, INT32_MAX, &model.source_faces);
  ReadHex(fields, "geometry", &model.geometry);
  if (json.contains("shape")) fields.Read("shape", &model.shape);
  ReadSplit(fields, &model.split);
  ReadClass(fields, info, &model.class_index);
  if (!fields.status().ok()) return fields.status();
  return model;
}

}  // namespace

const char* SplitName(Split split) {
  constexpr const char* kNames[] = {"train", "validation", "test"};
  return kNames[static_cast<int>(split)];
}

Path DatasetInfoPath(const Path& folder) { return folder / "dataset.json"; }
Path ModelsPath(const Path& folder) { return folder / "models.jsonl"; }
Path RejectedPath(const Path& folder) { return folder / "rejected.jsonl"; }
Path ContactSheetPath(const Path& folder) { return folder / "contact_sheet.png"; }
Path PicturesPath(const Path& folder) { return folder / "pictures.bin"; }
Path ModelFilePath(const Path& folder, const std::string& class_name, const std::string& id) {
  return folder / kModelFolder / class_name / (id + kModelEnding);
}

// Removes the file that marks the folder as ours last.
Status RemoveDataset(const Path& folder) {
  std::vector<Path> files = {ModelsPath(folder), RejectedPath(folder), ContactSheetPath(folder),
                             PicturesPath(folder)};
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator at(folder / kModelFolder, error), end;
       !error && at != end; at.increment(error)) {
    if (at->path().extension() == kModelEnding) files.push_back(at->path());
  }
  files.push_back(DatasetInfoPath(folder));
  return RemoveFiles(files);
}

Status WriteDatasetInfo(const Path& folder, const DatasetInfo& info) {
  Json json = {
      {"format", kFormat},       {"source", info.source},      {"image_size", info.image_size},
      {"views", info.views},     {"camera", CameraJson(info)}, {"classes", info.classes},
      {"credits", info.credits}, {"recipe", info.recipe}};
  if (!info.input.empty()) json["input"] = info.input;
  return WriteTextAtomic(DatasetInfoPath(folder), JsonText(json, 2) + "\n");
}

Result<DatasetInfo> ReadDatasetInfo(const Path& folder) {
  const std::string place = DatasetInfoPath(folder).string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(place));
  TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(text, place));
  JsonFields fields(json, place);
  DatasetInfo info;
  std::string format;
  fields.Read("format", &format);
  if (fields.status().ok() && format != kFormat)
    fields.Fail(
        DataLoss("{}: \"format\" is \"{}\", this program reads \"{}\"", place, format, kFormat));
  fields.Read("source", &info.source);
  fields.Read("image_size", 1, 4096, &info.image_size);
  fields.Read("views", 1, 4096, &info.views);
  fields.Read("classes", &info.classes);
  fields.Read("credits", &info.credits);
  fields.Read("recipe", &info.recipe);
  if (json.contains("input")) fields.Read("input", &info.input);
  if (!fields.status().ok()) return fields.status();
  TILEGRAD_TRY(ReadCamera(json.value("camera", nlohmann::json()), place + ": \"camera\"", &info));
  return info;
}

Status WriteModels(const Path& folder, const DatasetInfo& info,
                   const std::vector<ModelInfo>& models) {
  std::string text;
  for (const ModelInfo& model : models) text += JsonText(ModelJson(info, model)) + "\n";
  return WriteTextAtomic(ModelsPath(folder), text);
}

Result<std::vector<ModelInfo>> ReadModels(const Path& folder, const DatasetInfo& info) {
  const std::string file = ModelsPath(folder).string();
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::vector<ModelInfo> models;
  models.reserve(static_cast<std::size_t>(std::ranges::count(text, '\n')) + 1);
  std::set<std::pair<int, std::string>> seen;
  int line = 0;
  for (std::size_t begin = 0, end = 0; begin < text.size(); begin = end + 1) {
    end = std::min(text.find('\n', begin), text.size());
    const std::string_view row(text.data() + begin, end - begin);
    const std::string place = fmt::format("{}: line {}", file, ++line);
    TILEGRAD_ASSIGN(const nlohmann::json json, ParseJson(row, file, line));
    TILEGRAD_ASSIGN(ModelInfo model, ReadModel(json, place, info));
    if (!seen.emplace(model.class_index, model.id).second)
      return DataLoss("{}: the id \"{}\" appears twice in its class", place, model.id);
    models.push_back(std::move(model));
  }
  if (models.empty()) return DataLoss("{}: no models", file);
  return models;
}

Status WriteRejected(const Path& folder, const std::vector<RejectedModel>& rejected) {
  std::string text;
  for (const RejectedModel& model : rejected) {
    const Json json = {{"id", model.id},
                       {"class", model.class_name},
                       {"file", model.file},
                       {"reason", model.reason}};
    text += JsonText(json) + "\n";
  }
  return WriteTextAtomic(RejectedPath(folder), text);
}

}  // namespace tilegrad::train
