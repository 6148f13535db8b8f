// SPDX-License-Identifier: Apache-2.0
// Sources of models: the list is made at once, each model is loaded on demand.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/file.h"
#include "train/data/dataset.h"

namespace tilegrad::train {

class SplitList;

struct SourceEntry {
  std::string class_name;  // safe as a file name
  std::string id;          // unique in its class, safe as a file name
  std::string name, license, creator;
  std::string file;                 // for reports
  std::optional<Split> split = {};  // where the source fixes it
  // The same for all entries of a class that are one shape with other textures; empty: its own.
  std::string shape = {};
};

// A file or folder that a source skipped, and why: it may have been intended.
struct IgnoredFile {
  std::string file, reason;
};

struct SourceModel {
  // A mesh still to be normalised and rendered (y up, front towards +z), or finished data where the
  // source holds images instead.
  std::variant<Mesh, ModelData> data;
  std::vector<std::string> warnings = {};  // of its reader: a texture is missing, ...
  std::string inputs = {};                 // for ModelSource::IsUnchanged
};

// What a source says of itself.
struct SourceFacts {
  std::string name;                  // DatasetInfo::source
  std::vector<std::string> credits;  // DatasetInfo::credits
  std::string input = {};            // DatasetInfo::input
  // Whether it is a published set, of which hardly any model may be unusable.
  bool published = false;
  // Changes whenever the same entries give other models, as after a change to a list that says how
  // to read them; 0 if that cannot happen.
  std::uint64_t version = 0;
};

class ModelSource {
 public:
  explicit ModelSource(SourceFacts facts) : facts_(std::move(facts)) {}
  virtual ~ModelSource() = default;
  const SourceFacts& facts() const { return facts_; }
  const std::vector<SourceEntry>& entries() const { return entries_; }  // sorted by class, then id
  const std::vector<IgnoredFile>& ignored() const { return ignored_; }
  // Thread-safe. Called in ascending order, give or take the number of workers.
  virtual Result<SourceModel> Load(std::size_t entry) const = 0;
  // Whether Load would give the model that had these `inputs` (SourceModel), empty where an earlier
  // version loaded it. Installed and published models are what their ids say; files of users
  // change. Thread-safe.
  virtual bool IsUnchanged(std::size_t /*entry*/, const std::string& /*inputs*/) const {
    return true;
  }
  // Frees all of the entries but their files: nothing but Load and facts is called from now on.
  void ForgetEntries();
  // The camera and sizes that the source dictates, where it holds images.
  virtual std::optional<DatasetInfo> FixedInfo() const { return std::nullopt; }

 protected:
  const std::string& FileOf(std::size_t entry) const {
    return files_.empty() ? entries_[entry].file : files_[entry];
  }

  SourceFacts facts_;
  std::vector<SourceEntry> entries_;
  std::vector<IgnoredFile> ignored_;

 private:
  std::vector<std::string> files_;  // of entries that are forgotten
};

// Parametric coloured models from a few families, `per_class` of each, so that tests and demos need
// no files.
std::unique_ptr<ModelSource> ProceduralSource(int per_class, std::uint64_t seed);
const std::vector<std::string>& ProceduralClasses();  // car, chair, lamp, plane, table
// The `index`-th model of a class: a pure function of (class_index, index, seed). y up, front
// towards +z, about one unit tall, vertex colours, a soup of closed overlapping parts as modelled
// furniture is.
Mesh ProceduralModel(int class_index, std::uint64_t index, std::uint64_t seed);

// The eleven classes of data/sweethome3d_classes.tsv from the libraries LIBRARY.sh3f in `folder`.
// Errors: no library there (names the package), or one cannot be opened.
inline constexpr const char* kSweetHome3dFolder = "/usr/share/sweethome3d/furniture";
Result<std::unique_ptr<ModelSource>> SweetHome3dSource(const Path& folder);

// Models of Debian's packages of games, by lists in data/, all below `games`. Each set of textures
// (a livery, a skin) is an entry, and those of one model have its shape. Errors: a package is
// missing (named), or its archive cannot be opened.
inline constexpr const char* kGamesFolder = "/usr/share/games";
Result<std::unique_ptr<ModelSource>> PlanesSource(const Path& games);  // flightgear-data-ai
Result<std::unique_ptr<ModelSource>> ShipsSource(const Path& games);   // flightgear-data-models
// torcs-data, trigger-rally-data, ufoai-data
Result<std::unique_ptr<ModelSource>> CarsSource(const Path& games);

// The models of several sources, which hold meshes, as one; a class of the same name is one class.
std::unique_ptr<ModelSource> CombineSources(std::string name,
                                            std::vector<std::unique_ptr<ModelSource>> sources);

// folder/<class>/<file>, every file whose ending io::LoadMesh knows. Other files, except images and
// parts of a model, are `ignored`, as are models outside a class's folder or in a subfolder of one.
// Names that begin with '.' do not count. An error if two folders would be one class.
Result<std::unique_ptr<ModelSource>> FolderSource(const Path& folder);

// ShapeNetCore, version 1 or 2 (shapenet.cc), of the paper's 13 synsets; skips other folders. A
// model that lacks a file, a texture or a material library is an entry that fails to load. With a
// list (split_list.h) it uses only the listed models.
Result<std::unique_ptr<ModelSource>> ShapeNetSource(const Path& folder, const SplitList& list);

// Published renders of ShapeNet models; each file describes the layout: 3D-R2N2's (choy.cc), N3MR's
// as kept for DVR (dvr.cc, which has lists of its own) and the paper's (dibr.cc). Without a list
// 3D-R2N2's rule divides its set: the first 80 % of each class train, the others test.
Result<std::unique_ptr<ModelSource>> ChoySource(const Path& folder, const SplitList& list,
                                                int image_size);
Result<std::unique_ptr<ModelSource>> DvrSource(const Path& folder, const SplitList& list,
                                               int image_size);
Result<std::unique_ptr<ModelSource>> DibrSource(const Path& folder, const SplitList& list,
                                                int image_size);

// The renders of N3MR and SoftRas: folder/<class>_<train|val|test>_images.npz, uint8
// [N,24,4,64,64], with _voxels.npz, bool [N,32,32,32]. One pair of files is held in memory at a
// time.
Result<std::unique_ptr<ModelSource>> NmrSource(const Path& folder);
// N3MR's cameras in our frame (nmr.cc).
CameraRule NmrCameras();

// "airplane" for "02691156" and so on for the 13 synsets; other names stay as they are.
std::string SynsetName(const std::string& synset);

// The contents of a folder, sorted; errors name it.
Result<std::vector<Path>> ListFolder(const Path& folder);

// Turns any text into a file name: ASCII letters and digits, '.', '-', '_' and UTF-8 beyond ASCII
// stay; the rest, controls and what is no UTF-8 become '_'. A '_' comes before a first '.' and
// makes a name of nothing.
std::string SafeFileName(const std::string& text);

// The parts of `text` between separators; views of it, one more than there are separators.
std::vector<std::string_view> SplitText(std::string_view text, char separator);

// Sorts by class, then id, and makes ids unique in their class by appending "-2", "-3", ...
void SortEntries(std::vector<SourceEntry>* entries);

}  // namespace tilegrad::train
