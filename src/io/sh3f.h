// SPDX-License-Identifier: Apache-2.0
// Furniture libraries of Sweet Home 3D (.sh3f): a zip with OBJ models and a catalogue in Java's
// properties format.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "io/archive.h"
#include "scene/mesh.h"

namespace tilegrad::io {

struct FurnitureEntry {
  std::string id, name, creator;
  std::string model;  // path of the OBJ in the archive, without a leading slash
  // Row-major, for positions: turns the model so that y is up and the front faces +z.
  std::optional<std::array<float, 9>> rotation;
};

struct FurnitureCatalog {
  std::string license;
  std::vector<FurnitureEntry> entries;  // those with a model, in catalogue order
};

Result<FurnitureCatalog> ReadFurnitureCatalog(const FileSource& library);

// p -> rotation * p for positions and normals.
void ApplyRotation(Mesh& mesh, const std::array<float, 9>& rotation);

// Java's properties text in ISO-8859-1: comments, continuation lines, escapes; values come out in
// UTF-8.
std::vector<std::pair<std::string, std::string>> ParseProperties(const Bytes& text);

}  // namespace tilegrad::io
