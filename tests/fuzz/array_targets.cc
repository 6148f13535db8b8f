// SPDX-License-Identifier: Apache-2.0
// Readers of arrays and archives.
#include "fuzz/target.h"
#include "io/binvox.h"
#include "io/mat_file.h"
#include "io/npz.h"
#include "io/sh3f.h"
#include "nn/serialize.h"

namespace tilegrad::fuzz::array_targets {

void CheckArray(const io::NpyArray& array) {
  std::size_t count = 1;
  for (const std::size_t n : array.shape) count *= n;
  Require(array.data.size() == count * io::NpyTypeSize(array.type), "an array has its data");
}

void Npy(Input input) {
  const auto array = io::DecodeNpy(input, "array");
  if (!Accepted(array)) return;
  CheckArray(*array);
  const auto again = io::DecodeNpy(io::EncodeNpy(*array), "again");
  Require(again.ok() && again->data == array->data && again->shape == array->shape,
          "what was written comes back");
}

void Binvox(Input input) {
  const auto grid = io::DecodeBinvox(input, "grid");
  if (!Accepted(grid)) return;
  const auto again = io::DecodeBinvox(io::EncodeBinvox(*grid), "again");
  Require(again.ok() && again->voxels == grid->voxels && again->translate == grid->translate &&
              again->scale == grid->scale,
          "what was written comes back");
}

void Npz(Input input) {
  const MemoryFile file(input);
  const auto arrays = io::LoadNpz(file.path());
  if (!Accepted(arrays)) return;
  for (const auto& [name, array] : *arrays) CheckArray(array);
}

// A library of furniture: every file of the catalogue is read.
void Zip(Input input) {
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
    (void)Accepted(bytes);
  }
  const auto catalog = io::ReadFurnitureCatalog(**zip);
  if (!Accepted(catalog)) return;
  for (const io::FurnitureEntry& entry : catalog->entries) {
    Require(!entry.model.empty(), "an entry has a model");
  }
}

void Properties(Input input) {
  (void)io::ParseProperties(Bytes(input.begin(), input.end()));
  const MemorySource library("PluginFurnitureCatalog.properties", input);
  const auto catalog = io::ReadFurnitureCatalog(library);
  (void)Accepted(catalog);
}

void Safetensors(Input input) {
  static const Workers one(1);
  nn::Context context(one);
  (void)nn::SafetensorsMetadata(input);
  const auto file = nn::DecodeSafetensors(context, input);
  if (!Accepted(file)) return;
  const auto bytes = nn::EncodeSafetensors(*file);
  Require(bytes.ok(), "what was read can be written");
  const auto again = nn::DecodeSafetensors(context, *bytes);
  Require(again.ok() && again->tensors.size() == file->tensors.size(), "and comes back");
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
    if (!Accepted(place)) return;
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
  PutFile("a.mat", input);
  const auto file = io::LoadMat(ScratchFolder() / "a.mat");
  if (!Accepted(file)) return;
  for (const auto& [name, array] : file->variables) CheckMat(array);
  WalkMat(*file);
}

// What the reading process hands over.
void MatFromReader(Input input) {
  const auto variables = io::MatFromReader(input);
  if (!Accepted(variables)) return;
  for (const auto& [name, array] : *variables) CheckMat(array);
}

std::vector<Bytes> MatFromReaderSeeds() {
  using io::MatArray;
  const io::MatVariables variables = {
      {"images", MatArray::Structs({"rel_path", "mask", "bbox"},
                                   {MatArray::Text("a.jpg"), MatArray::Mask(2, 2, {1, 0, 1, 1}),
                                    MatArray::Structs({"x1"}, {MatArray::Number(0.25)})})},
      {"S", MatArray::Numbers({3, 1}, std::vector<double>{0.5, -1, 1e-300})}};
  return {io::MatForReader(variables)};
}

const Registration kTargets[] = {
    Registration({"binvox", Binvox}),
    Registration({.name = "mat", .run = Mat, .mutations = 40}),
    Registration({"mat_from_reader", MatFromReader, MatFromReaderSeeds}),
    Registration({"npy", Npy}),
    Registration({"npz", Npz}),
    Registration({"zip", Zip}),
    Registration({"properties", Properties}),
    Registration({"safetensors", Safetensors}),
};

}  // namespace tilegrad::fuzz::array_targets
