// SPDX-License-Identifier: Apache-2.0
// Where models come from: a list made at once, and each model loaded when its turn comes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/file.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

struct SourceEntry {
  std::string class_name;  // safe as a file name
  std::string id;          // unique in its class, safe as a file name
  std::string name, license, creator;
  std::string file;            // for reports
  std::optional<Split> split;  // where the source fixes it
};

struct SourceModel {
  // A mesh still to be normalised and rendered (y up, front towards +z), or finished data where the
  // source holds images instead.
  std::variant<Mesh, ModelData> data;
  std::vector<std::string> warnings = {};  // of reading it: a texture is missing, ...
};

class ModelSource {
 public:
  virtual ~ModelSource() = default;
  virtual std::string name() const = 0;                         // DatasetInfo::source
  virtual std::vector<std::string> credits() const = 0;         // DatasetInfo::credits
  virtual const std::vector<SourceEntry>& entries() const = 0;  // sorted by class, then id
  // Thread-safe. Entries are asked for in ascending order, give or take the number of workers.
  virtual Result<SourceModel> Load(std::size_t entry) const = 0;
  // The camera and sizes that the source dictates, where it holds images.
  virtual std::optional<DatasetInfo> FixedInfo() const { return std::nullopt; }
};

// Parametric furniture, lamps, cars and planes (procedural.h), `per_class` of each.
std::unique_ptr<ModelSource> ProceduralSource(int per_class, std::uint64_t seed);

// The eleven classes of data/sweethome3d_classes.tsv from the libraries LIBRARY.sh3f in `folder`.
// Errors: no library there (says which package holds them), or one cannot be opened.
inline constexpr const char* kSweetHome3dFolder = "/usr/share/sweethome3d/furniture";
Result<std::unique_ptr<ModelSource>> SweetHome3dSource(const Path& folder);

// folder/<class>/<file>, every file whose ending io::LoadMesh knows.
Result<std::unique_ptr<ModelSource>> FolderSource(const Path& folder);

// folder/<synset>/<model>/models/model_normalized.obj, the paper's 13 synsets; other folders
// are not looked at. `split_list`, if not empty, is a text file of lines "<synset>/<model> <split>"
// with train, val or test; then only the models that it lists are used.
Result<std::unique_ptr<ModelSource>> ShapeNetSource(const Path& folder, const Path& split_list);

// The renders of N3MR and SoftRas: folder/<class>_<train|val|test>_images.npz, uint8
// [N,24,4,64,64], with _voxels.npz, bool [N,32,32,32]. One pair of files is held in memory at a
// time.
Result<std::unique_ptr<ModelSource>> NmrSource(const Path& folder);

// "airplane" for "02691156" and so on for the 13 synsets; other names stay as they are.
std::string SynsetName(const std::string& synset);

// What is in a folder, sorted; an error that names it.
Result<std::vector<Path>> ListFolder(const Path& folder);

// Turns any text into a file name: letters, digits, '.', '-' and '_' stay, the rest becomes '_'.
std::string SafeFileName(const std::string& text);

// Sorts by class, then id, and makes ids unique in their class by appending "-2", "-3", ...
void SortEntries(std::vector<SourceEntry>* entries);

}  // namespace tilegrad::train
