// SPDX-License-Identifier: Apache-2.0
// Readers of arrays and archives.
#include "base/read_budget.h"
#include "fuzz/target.h"
#include "io/binvox.h"
#include "io/mat_file.h"
#include "io/npz.h"
#include "io/sh3f.h"
#include "nn/serialize.h"

namespace tilegrad::fuzz::array_targets {

constexpr std::size_t kBudget = std::size_t{64} << 20;

void CheckArray(const io::NpyArray& array) {
  std::size_t count = 1;
  for (const std::size_t n : array.shape) count *= n;
  Require(array.data.size() == count * io::NpyTypeSize(array.type), "an array has its data");
}

void Npy(Input input) {
  const ReadBudget budget(kBudget);
  const auto array = io::DecodeNpy(input, "array");
  if (!array.ok()) return Require(!array.status().message().empty(), "an error has a message");
  CheckArray(*array);
  const auto again = io::DecodeNpy(io::EncodeNpy(*array), "again");
  Require(again.ok() && again->data == array->data && again->shape == array->shape,
          "what was written comes back");
}

void Binvox(Input input) {
  const ReadBudget budget(kBudget);
  const auto grid = io::DecodeBinvox(input, "grid");
  if (!grid.ok()) return Require(!grid.status().message().empty(), "an error has a message");
  const auto again = io::DecodeBinvox(io::EncodeBinvox(*grid), "again");
  Require(again.ok() && again->voxels == grid->voxels && again->translate == grid->translate &&
              again->scale == grid->scale,
          "what was written comes back");
}

std::vector<Bytes> BinvoxSeeds() {
  return {io::EncodeBinvox({2, {-0.5, -0.5, 0.25}, 1.5, {0, 1, 1, 0, 0, 0, 1, 0}})};
}

io::NpyArray SampleArray() {
  const float values[] = {1, 2, 3, 4, 5, 6};
  return io::MakeNpy<float>({2, 3}, values);
}

std::vector<Bytes> NpySeeds() {
  const std::uint8_t bytes[] = {1, 0};
  const std::string header =
      "{'descr': '<i4', 'fortran_order': True, 'shape': (2, 1), }                    \n";
  std::string fortran("\x93NUMPY\1\0", 8);
  fortran += static_cast<char>(header.size());
  fortran.append(1, '\0').append(header).append("abcdefgh");
  return {io::EncodeNpy(SampleArray()), io::EncodeNpy(io::MakeNpy<std::uint8_t>({2}, bytes)),
          ToBytes(fortran)};
}

void Npz(Input input) {
  const ReadBudget budget(kBudget);
  const MemoryFile file(input);
  const auto arrays = io::LoadNpz(file.path());
  if (!arrays.ok()) return Require(!arrays.status().message().empty(), "an error has a message");
  for (const auto& [name, array] : *arrays) CheckArray(array);
}

std::vector<Bytes> NpzSeeds() {
  return {Written("a.npz", [](const Path& path) {
    return io::SaveNpz(path, {{"a", SampleArray()}, {"b", SampleArray()}});
  })};
}

// A library of furniture: every file of the catalogue is read.
void Zip(Input input) {
  const ReadBudget budget(kBudget);
  const MemoryFile file(input);
  const auto names = io::ListZip(file.path());
  const auto zip = io::OpenZip(file.path());
  (void)io::ZipFingerprint(file.path());
  if (!names.ok() || !zip.ok()) return;
  std::size_t read = 0;
  for (const std::string& name : *names) {
    if (++read > 8) break;
    (void)(*zip)->Exists(name);
    const auto bytes = (*zip)->Read(name);
    Require(bytes.ok() || !bytes.status().message().empty(), "an error has a message");
  }
  const auto catalog = io::ReadFurnitureCatalog(**zip);
  if (!catalog.ok()) return Require(!catalog.status().message().empty(), "an error has a message");
  for (const io::FurnitureEntry& entry : catalog->entries) {
    Require(!entry.model.empty(), "an entry has a model");
  }
}

constexpr std::string_view kCatalog =
    "# c\nid=lib\nname=Lib\nlicense=CC0\nid#1=chair\nname#1=Chair "
    "\\u00e9\ncategory#1=x\nmodel#1=/a/"
    "chair.obj\nwidth#1=45.5\ndepth#1=40\nheight#1=90\nmodelRotation#1=1 0 0 0 1 0 0 0 \\\n  "
    "1\ncreator#1=N\nmultiPartModel#1=true\n";

std::vector<Bytes> ZipSeeds() {
  return {Written("a.sh3f", [](const Path& path) {
    return io::WriteZip(path, {{"PluginFurnitureCatalog.properties", ToBytes(kCatalog)},
                               {"a/chair.obj", ToBytes("v 0 0 0\n")}});
  })};
}

void Properties(Input input) {
  (void)io::ParseProperties(Bytes(input.begin(), input.end()));
  const MemorySource library("PluginFurnitureCatalog.properties", input);
  const auto catalog = io::ReadFurnitureCatalog(library);
  Require(catalog.ok() || !catalog.status().message().empty(), "an error has a message");
}

void Safetensors(Input input) {
  static const Workers one(1);
  const ReadBudget budget(kBudget);
  nn::Context context(one);
  (void)nn::SafetensorsMetadata(input);
  const auto file = nn::DecodeSafetensors(context, input);
  if (!file.ok()) return Require(!file.status().message().empty(), "an error has a message");
  const auto bytes = nn::EncodeSafetensors(*file);
  Require(bytes.ok(), "what was read can be written");
  const auto again = nn::DecodeSafetensors(context, *bytes);
  Require(again.ok() && again->tensors.size() == file->tensors.size(), "and comes back");
}

std::vector<Bytes> SafetensorsSeeds() {
  const Workers one(1);
  nn::Context context(one);
  const std::int32_t indices[] = {3, -1};
  return {*nn::EncodeSafetensors(
              {{{"a.weight", context.Full({2, 3}, 0.5)}, {"b", context.Indices(indices)}},
               {{"format", "x"}}}),
          *nn::EncodeSafetensors({})};
}

// An array as the reader makes it: its elements and numbers fit its dims.
void CheckMat(const io::MatArray& array) {
  const bool structs = array.kind == io::MatKind::kStruct;
  const std::size_t each = structs ? array.fields.size() : array.kind == io::MatKind::kCell;
  Require(array.elements.size() == each * array.places(), "an array has its elements");
  if (array.kind == io::MatKind::kNumbers) {
    Require(array.numbers.size() == array.places(), "an array has its numbers");
  }
  for (const io::MatArray& element : array.elements) CheckMat(element);
}

// Every variable as annotations are read: fields by their names, numbers and text.
void WalkMat(const io::MatFile& file) {
  for (const auto& [name, array] : file.variables) {
    const auto place = io::MatPlace::Variable(file, name);
    if (!place.ok()) return Require(!place.status().message().empty(), "an error has a message");
    for (const std::string& field : place->array().fields) {
      const auto inner = place->Field(0, field);
      if (!inner.ok()) continue;
      (void)inner->Number();
      (void)inner->Text();
      (void)inner->Numbers(4);
    }
  }
}

// A process for each input: the library may go wrong, but not this program.
void Mat(Input input) {
  const ReadBudget budget(kBudget);
  PutFile("a.mat", input);
  const auto file = io::LoadMat(ScratchFolder() / "a.mat");
  if (!file.ok()) return Require(!file.status().message().empty(), "an error has a message");
  for (const auto& [name, array] : file->variables) CheckMat(array);
  WalkMat(*file);
}

io::MatVariables SampleVariables() {
  using io::MatArray;
  return {{"images", MatArray::Structs({"rel_path", "mask", "bbox"},
                                       {MatArray::Text("a.jpg"), MatArray::Mask(2, 2, {1, 0, 1, 1}),
                                        MatArray::Structs({"x1"}, {MatArray::Number(0.25)})})},
          {"S", MatArray::Numbers({3, 1}, std::vector<double>{0.5, -1, 1e-300})}};
}

std::vector<Bytes> MatSeeds() {
  return {Written("b.mat", [](const Path& path) { return io::SaveMat(path, SampleVariables()); })};
}

// What the reading process hands over.
void MatFromReader(Input input) {
  const auto variables = io::MatFromReader(input);
  if (!variables.ok()) return Require(!variables.status().message().empty(), "it has a message");
  for (const auto& [name, array] : *variables) CheckMat(array);
}

std::vector<Bytes> MatFromReaderSeeds() { return {io::MatForReader(SampleVariables())}; }

const Registration kTargets[] = {
    Registration({"binvox", Binvox, BinvoxSeeds}),
    Registration({"mat", Mat, MatSeeds, nullptr, 40}),
    Registration({"mat_from_reader", MatFromReader, MatFromReaderSeeds}),
    Registration({"npy", Npy, NpySeeds}),
    Registration({"npz", Npz, NpzSeeds}),
    Registration({"zip", Zip, ZipSeeds}),
    Registration({"properties", Properties, [] { return std::vector<Bytes>{ToBytes(kCatalog)}; }}),
    Registration({"safetensors", Safetensors, SafetensorsSeeds}),
};

}  // namespace tilegrad::fuzz::array_targets
