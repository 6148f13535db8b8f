// SPDX-License-Identifier: Apache-2.0
#include "train/data/sources/package_models.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <map>
#include <span>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/sh3f.h"
#include "io/text_scan.h"
#include "scene/mesh.h"
#include "scene/shapes.h"
#include "train/data/split.h"

namespace tilegrad::train {
namespace {

// Images of `folder` stand in for those of the same name elsewhere.
class WithTextures : public io::FileSource {
 public:
  WithTextures(const io::FileSource& files, const std::string& folder)
      : files_(files), folder_(folder) {}
  Result<Bytes> Read(const std::string& name) const override { return files_.Read(Find(name)); }
  bool Exists(const std::string& name) const override { return files_.Exists(Find(name)); }
  std::string Describe(const std::string& name) const override {
    return files_.Describe(Find(name));
  }

 private:
  std::string Find(const std::string& name) const {
    const std::string here = (Path(folder_) / Path(name).filename()).string();
    return files_.Exists(here) ? here : name;
  }

  const io::FileSource& files_;
  const std::string& folder_;
};

// Replaces the file's materials, and drops warnings about them.
Status Paint(const io::FileSource& files, const std::string& image, io::LoadedMesh* loaded) {
  TILEGRAD_ASSIGN(const Bytes bytes, files.Read(image));
  TILEGRAD_ASSIGN(ImageU8 pixels, io::DecodeImage(bytes, files.Describe(image)));
  Mesh& mesh = loaded->mesh;
  if (mesh.corner_uvs.empty()) return DataLoss("{}: has no uv", files.Describe(image));
  mesh.textures = {{image, io::ToColor(std::move(pixels))}};
  mesh.materials.assign(1, {});
  mesh.materials[0].base_color = glm::vec4(1);
  mesh.materials[0].base_color_texture = 0;
  mesh.face_materials.clear();
  loaded->warnings.clear();
  return {};
}

// Folders of the archive that match the parts of a pattern, named by what its stars match.
void Match(const Path& archive, const Path& at, std::span<const Path> parts,
           const std::string& name, std::vector<TextureSet>* out) {
  if (parts.empty()) return;
  const Path& part = parts.front();
  if (part != "*") {
    if (parts.size() > 1) return Match(archive, at / part, parts.subspan(1), name, out);
    if (PathExists(archive / at / part)) out->push_back({name, at.string(), ""});
    return;
  }
  const auto folders = ListFolder(archive / at);
  if (!folders.ok()) return;
  for (const Path& folder : *folders) {
    if (!IsFolder(folder)) continue;
    const std::string own = folder.filename().string();
    Match(archive, at / own, parts.subspan(1), name.empty() ? own : name + "-" + own, out);
  }
}

// Loads a mesh with one of its sets of textures.
Result<io::LoadedMesh> LoadWithTextures(const io::FileSource& files, const std::string& model,
                                        const TextureSet& textures) {
  if (!textures.folder.empty()) return io::LoadMesh(WithTextures(files, textures.folder), model);
  TILEGRAD_ASSIGN(io::LoadedMesh loaded, io::LoadMesh(files, model));
  if (!textures.image.empty()) TILEGRAD_TRY(Paint(files, textures.image, &loaded));
  return loaded;
}

struct Wheel {
  glm::vec3 centre;  // in the file's frame and units
  float radius = 0, width = 0;
};

constexpr int kSegments = 24;
constexpr glm::vec4 kTyre = {0.09f, 0.09f, 0.1f, 1}, kRim = {0.62f, 0.62f, 0.64f, 1};
constexpr float kRimRadius = 0.62f, kRimWidth = 1.03f;  // of the tyre's

// A disc about y, coloured.
Mesh Disc(float radius, float width, glm::vec4 color) {
  Mesh disc = Frustum(glm::vec3(0), radius, radius, width, kSegments);
  disc.materials = {Material{.name = "wheel", .base_color = glm::vec4(1)}};
  SetColor(disc, color);
  return disc;
}

// "x y z radius width", several separated by '|'.
Result<std::vector<Wheel>> ReadWheels(std::string_view text) {
  std::vector<Wheel> wheels = {};
  if (text.empty()) return wheels;
  for (std::string_view part : SplitText(text, '|')) {
    Wheel wheel;
    for (float* value :
         {&wheel.centre.x, &wheel.centre.y, &wheel.centre.z, &wheel.radius, &wheel.width}) {
      if (!io::ParseNumber(io::NextToken(part), *value))
        return InvalidArgument("a wheel needs five numbers: x y z radius width");
    }
    wheels.push_back(wheel);
  }
  return wheels;
}

// Adds a tyre of dark grey with a rim of light grey on either side; `axle` is the axis of the file
// that it turns about, of length 1.
void AddWheel(const Wheel& wheel, glm::vec3 axle, Mesh* mesh) {
  Mesh both = Disc(wheel.radius, wheel.width, kTyre);
  Append(both, Disc(kRimRadius * wheel.radius, kRimWidth * wheel.width, kRim));
  const glm::vec3 side = std::abs(axle.x) > 0.5f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0);
  Transform(both, {side, axle, glm::cross(side, axle)}, wheel.centre);
  Append(*mesh, both);
}

struct Package {
  std::string_view name;
  const char* archive;  // a folder or zip below /usr/share/games
  const char* credit;
};

constexpr Package kPackages[] = {
    {"flightgear-data-ai", "flightgear/AI/Aircraft",
     "3D models of aircraft: the FlightGear team (GPL-2+)."},
    {"flightgear-data-models", "flightgear/Models",
     "3D models of ships: the FlightGear team (GPL-2+)."},
    {"torcs-data", "torcs",
     "3D models of cars: TORCS (Free Art License: Jean-Christophe Durieu, ViPeR; GPL-2+: Eric "
     "Espié, Christophe Guionneau, Bernhard Wymann, Andrea Alfieri)."},
    {"trigger-rally-data", "trigger-rally/data.zip",
     "3D models of cars: Trigger Rally (GPL-2+: Jasmine Langridge, Richard Langridge and others)."},
    {"ufoai-data", "ufoai/base/0models.pk3",
     "3D models of cars: UFO: Alien Invasion (GPL-2, GPL-2+: its contributors)."}};

using WordList = std::vector<std::string_view>;

// A line of a list.
struct PackageRow {
  std::string class_name, shape, name, package, license, model;
  std::string_view front, up;          // axes of the file: "-x", "z", ...
  std::vector<std::string> with = {};  // other files of the same model
  WordList without = {};               // as PackageList::without
  std::string_view textures;           // FindTextureSets
  std::vector<Wheel> wheels = {};
};

Result<std::vector<PackageRow>> ReadPackageRows(const PackageList& list) {
  std::vector<PackageRow> rows;
  int number = 0;
  for (const std::string_view line : SplitText(list.text, '\n')) {
    ++number;
    const auto part = SplitText(line, '\t');
    if (line.empty() || part[0] == "class") continue;
    if (part.size() != 12)
      return InternalError("list {}: line {}: {} columns", list.name, number, part.size());
    PackageRow row{.class_name = std::string(part[0]),
                   .shape = std::string(part[1]),
                   .name = std::string(part[2]),
                   .package = std::string(part[3]),
                   .license = std::string(part[4]),
                   .model = std::string(part[5]),
                   .front = part[6],
                   .up = part[7],
                   .textures = part[10]};
    TILEGRAD_ASSIGN(row.wheels, ReadWheels(part[11]));
    if (!part[8].empty()) {
      for (const auto file : SplitText(part[8], '|')) row.with.emplace_back(file);
    }
    if (!part[9].empty()) row.without = SplitText(part[9], '|');
    rows.push_back(std::move(row));
  }
  return rows;
}

glm::vec3 Axis(std::string_view text) {
  glm::vec3 axis(0);
  axis[text.back() - 'x'] = text.front() == '-' ? -1.0f : 1.0f;
  return axis;
}

// The rotation that takes `front` to +z and `up` to +y, row-major.
std::array<float, 9> TurnOf(const PackageRow& row) {
  const glm::vec3 z = Axis(row.front), y = Axis(row.up), x = glm::cross(y, z);
  return {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
}

bool HasOneOf(const std::string& name, const WordList& words) {
  const std::string lower = LowerCase(name);
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return lower.find(word) != std::string::npos; });
}

// Takes the faces out whose object or texture has one of the words in its name.
void LeaveOut(const WordList& words, io::LoadedMesh* loaded) {
  Mesh& mesh = loaded->mesh;
  std::vector<char> keep(mesh.faces.size(), 1);
  for (std::size_t p = 0; p < loaded->parts.size(); ++p) {
    if (!HasOneOf(loaded->parts[p].name, words)) continue;
    const std::size_t begin = loaded->parts[p].first_face;
    const std::size_t end =
        p + 1 < loaded->parts.size() ? loaded->parts[p + 1].first_face : keep.size();
    std::fill_n(keep.begin() + static_cast<std::ptrdiff_t>(begin), end - begin, 0);
  }
  std::vector<char> out;  // of materials
  for (const Material& material : mesh.materials) {
    const int texture = material.base_color_texture;
    out.push_back(texture >= 0 &&
                  HasOneOf(mesh.textures[static_cast<std::size_t>(texture)].name, words));
  }
  for (std::size_t f = 0; f < mesh.face_materials.size(); ++f)
    keep[f] = keep[f] && !out[static_cast<std::size_t>(mesh.face_materials[f])];
  KeepFaces(keep, &mesh);
}

class Models : public ModelSource {
 public:
  explicit Models(const PackageList& list)
      : ModelSource({.name = list.name, .credits = {}, .version = HashText(list.text, 0)}),
        without_(list.without) {
    for (const std::string_view word : without_) facts_.version = HashText(word, facts_.version);
  }

  Status Open(const std::vector<PackageRow>& rows, const Path& games) {
    for (const Package& package : kPackages) {
      if (std::any_of(rows.begin(), rows.end(),
                      [&](const PackageRow& row) { return row.package == package.name; }))
        TILEGRAD_TRY(OpenPackage(package, rows, games));
    }
    SortEntries(&entries_);
    return {};
  }

  Result<SourceModel> Load(std::size_t entry) const override {
    const Item& item = items_.at(FileOf(entry));
    const io::FileSource& files = *archives_.at(item.row.package);
    TILEGRAD_ASSIGN(io::LoadedMesh loaded, LoadWithTextures(files, item.row.model, item.textures));
    LeaveOut(without_, &loaded);
    LeaveOut(item.row.without, &loaded);
    for (const std::string& file : item.row.with) {
      TILEGRAD_ASSIGN(const io::LoadedMesh part, io::LoadMesh(files, file));
      Append(loaded.mesh, part.mesh);
      loaded.warnings.insert(loaded.warnings.end(), part.warnings.begin(), part.warnings.end());
    }
    const glm::vec3 axle = glm::cross(Axis(item.row.up), Axis(item.row.front));
    for (const Wheel& wheel : item.row.wheels) AddWheel(wheel, axle, &loaded.mesh);
    io::ApplyRotation(loaded.mesh, TurnOf(item.row));
    return SourceModel{std::move(loaded.mesh), std::move(loaded.warnings)};
  }

 private:
  struct Item {
    PackageRow row;
    TextureSet textures;
  };

  Status OpenPackage(const Package& package, const std::vector<PackageRow>& rows,
                     const Path& games) {
    const Path archive = games / package.archive;
    const bool folder = IsFolder(archive);
    std::shared_ptr<io::FileSource>& files = archives_[std::string(package.name)];
    if (folder) {
      files = io::OpenFolder(archive);
    } else if (PathExists(archive)) {
      TILEGRAD_ASSIGN(files, io::OpenZip(archive));
    }
    bool found = false;
    for (const PackageRow& row : rows) {
      if (row.package != package.name || files == nullptr) continue;
      found = found || files->Exists(row.model);
      Add(row, folder ? archive : Path());
    }
    if (!found)
      return NotFound(
          "{}: models not found; install them with `sudo apt-get install --no-install-recommends "
          "{}`",
          archive.string(), package.name);
    facts_.credits.emplace_back(package.credit);
    return {};
  }

  void Add(const PackageRow& row, const Path& archive) {
    const std::string model = archives_.at(row.package)->Describe(row.model);
    for (TextureSet& textures : FindTextureSets(row.textures, archive)) {
      const std::string& set = textures.name;
      const std::string file = set.empty() ? model : model + " (" + set + ")";
      SourceEntry entry{row.class_name,
                        SafeFileName(set.empty() ? row.shape : row.shape + "-" + set),
                        set.empty() ? row.name : row.name + ", " + set,
                        row.license,
                        "",
                        file};
      entry.shape = row.shape;
      entries_.push_back(std::move(entry));
      items_[file] = {row, std::move(textures)};
    }
  }

  const WordList without_;
  std::map<std::string, std::shared_ptr<io::FileSource>> archives_;  // by package
  std::map<std::string, Item> items_;                                // by SourceEntry::file
};

}  // namespace

Result<std::unique_ptr<ModelSource>> PackageModels(const PackageList& list, const Path& games) {
  TILEGRAD_ASSIGN(const std::vector<PackageRow> rows, ReadPackageRows(list));
  auto source = std::make_unique<Models>(list);
  TILEGRAD_TRY(source->Open(rows, games));
  return std::unique_ptr<ModelSource>(std::move(source));
}

Result<std::unique_ptr<ModelSource>> PlanesSource(const Path& games) {
  // What a propeller looks like when it turns, flames, and the glow of lamps.
  return PackageModels(
      {"planes",
       PlanesList(),
       {"blur", "propdis", "propellerdisk", "prop_disk", "fast", "slow", "propturn", "prop_spin",
        "spinning", "propeller-disc", "halo", "glow", "flame", "conden"}},
      games);
}

Result<std::unique_ptr<ModelSource>> ShipsSource(const Path& games) {
  return PackageModels({"ships", ShipsList(), {"wake", "water"}}, games);
}

Result<std::unique_ptr<ModelSource>> CarsSource(const Path& games) {
  return PackageModels({"cars", CarsList(), {}}, games);
}

std::vector<TextureSet> FindTextureSets(std::string_view column, const Path& archive) {
  std::vector<TextureSet> sets;
  if (column.empty()) return {TextureSet()};
  for (const std::string_view text : SplitText(column, '|')) {
    const std::string part(text);
    if (part == ".") {
      sets.emplace_back();
    } else if (part.starts_with('=')) {
      sets.push_back({Path(part).stem().string(), "", part.substr(1)});
    } else {
      const Path path(part);
      const std::vector<Path> parts(path.begin(), path.end());
      Match(archive, "", parts, "", &sets);
    }
  }
  return sets;
}

}  // namespace tilegrad::train
