// SPDX-License-Identifier: Apache-2.0
// Holds the tree to docs/architecture.md: which folders there are, who may include whom, which
// foreign library lives where, and which files make up a kernel. Lengths: sizes.py.
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "base/file.h"
#include "support/source_dir.h"
#include "tilegrad/version.h"

namespace tilegrad::structure_test {

const Path kRoot = TILEGRAD_SOURCE_DIR;

struct Include {
  std::string file;    // from the root, e.g. src/raster/bin.cc
  std::string target;  // as written between the quotes or brackets
};

enum class Marks { kQuotesOrBrackets, kQuotes };

std::vector<Include> IncludesUnder(const Path& folder, Marks marks = Marks::kQuotesOrBrackets) {
  static const std::regex any(R"(^\s*#\s*include\s*["<]([^">]+)[">])"),
      quoted(R"(^\s*#\s*include\s*["]([^"]+)["])");
  std::vector<Include> out;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kRoot / folder)) {
    const std::string extension = entry.path().extension();
    if (extension != ".h" && extension != ".cc") continue;
    std::istringstream lines(ReadText(entry.path()).value());
    std::smatch match;
    for (std::string line; std::getline(lines, line);) {
      if (std::regex_search(line, match, marks == Marks::kQuotes ? quoted : any)) {
        out.push_back({std::filesystem::relative(entry.path(), kRoot).string(), match[1]});
      }
    }
  }
  return out;
}

std::string FirstPart(const std::string& path) { return path.substr(0, path.find('/')); }

std::set<std::string> FoldersIn(const Path& folder) {
  std::set<std::string> out;
  for (const auto& entry : std::filesystem::directory_iterator(kRoot / folder)) {
    if (entry.is_directory()) out.insert(entry.path().filename().string());
  }
  return out;
}

template <class Value>
std::set<std::string> Keys(const std::map<std::string, Value>& map) {
  std::set<std::string> out;
  for (const auto& [key, value] : map) out.insert(key);
  return out;
}

// Folder -> folders of src/ it may include besides itself. Every folder may include tilegrad/ and
// the standard library. `compat` stands above the renderer: the rules of other frameworks are not
// ours, so neither kernels nor renderer know them.
const std::map<std::string, std::set<std::string>> kMayInclude = {
    {"base", {}},
    {"scene", {"base"}},
    {"nn", {"base"}},
    {"io", {"scene", "base"}},
    {"raster", {"scene", "base"}},
    {"shade", {"raster", "scene", "base"}},
    {"render", {"shade", "raster", "scene", "base"}},
    {"compat", {"render", "shade", "raster", "scene", "base"}},
    {"api", {"render", "shade", "raster", "scene", "base"}},
    {"rivals", {"raster", "scene", "base"}},
    {"train", {"rivals", "render", "nn", "io", "scene", "base"}},
    {"fit", {"train", "render", "nn", "io", "scene", "base"}},
    {"proof", {"fit", "train", "render", "raster", "shade", "nn", "io", "scene", "base"}},
    {"cli", {"proof", "fit", "train", "render", "nn", "io", "scene", "base"}},
};

// Room of src/train -> rooms it may include besides itself. Losses, models and metrics know nothing
// of each other, and a sum of losses the values that a step logs; a run knows no task; the report
// asks the task and names no loss.
const std::map<std::string, std::set<std::string>> kMayIncludeInTrain = {
    {"losses", {"run"}},
    {"metrics", {}},
    {"ranks", {}},
    {"run", {}},  // knows no task, no loss and no data
    {"data", {"metrics", "ranks", "run"}},
    {"models", {}},
    {"eval", {"metrics", "data", "ranks", "run"}},
    {"tasks", {"eval", "models", "losses", "metrics", "data", "ranks", "run"}},
    {"report", {"tasks", "eval", "metrics", "data", "run"}},
};

// Whose rules src/compat follows, in a folder or in files that begin with the name.
const char* const kFrameworks[] = {"kaolin", "nvdiffrast", "pytorch3d"};

// The framework of a file in compat/x, or of one whose name begins with x_; "" for what several
// share.
std::string FrameworkOf(const std::string& target) {
  for (const std::string framework : kFrameworks) {
    if (target.rfind("compat/" + framework + "/", 0) == 0) return framework;
    if (target.rfind("compat/" + framework + "_", 0) == 0) return framework;
  }
  return "";
}

TEST(Structure, FoldersAreTheOnesListedHere) {
  EXPECT_EQ(FoldersIn("src"), Keys(kMayInclude));
  EXPECT_EQ(FoldersIn("src/train"), Keys(kMayIncludeInTrain));
  for (const std::string framework : kFrameworks) {
    const Path mirror = kRoot / "python/tilegrad/compat" / framework;
    EXPECT_TRUE(std::filesystem::exists(mirror) || std::filesystem::exists(mirror.string() + ".py"))
        << "src/compat/" << framework << " has no python/tilegrad/compat/" << framework;
  }
}

// Between folders of `root`, in which includes begin with `prefix`.
void ExpectOneWay(const std::string& root, const std::string& prefix,
                  const std::map<std::string, std::set<std::string>>& may_include) {
  int between = 0;
  for (const auto& [file, target] : IncludesUnder(root)) {
    const std::string from = FirstPart(file.substr(root.size() + 1));
    const std::string to =
        target.starts_with(prefix) ? FirstPart(target.substr(prefix.size())) : "";
    const auto rule = may_include.find(from);
    if (rule == may_include.end() || may_include.count(to) == 0 || to == from) continue;
    ++between;
    EXPECT_TRUE(rule->second.count(to))
        << file << " includes " << target << ", but " << from << " may not include " << to;
  }
  EXPECT_GT(between, 40);  // the search itself works
}

TEST(Structure, IncludesPointOneWay) { ExpectOneWay("src", "", kMayInclude); }
TEST(Structure, RoomsOfTrainIncludeOneWay) {
  ExpectOneWay("src/train", "train/", kMayIncludeInTrain);
}

// From src/ or include/, so that an include tells the folder: the tests above see it.
TEST(Structure, IncludesBeginWithAFolder) {
  for (const auto& [file, target] : IncludesUnder("src", Marks::kQuotes)) {
    const std::string folder = FirstPart(target);
    EXPECT_TRUE(folder == "tilegrad" || kMayInclude.count(folder))
        << file << " includes " << target;
  }
}

// A file of framework x declares tilegrad::compat::x, and knows of no other framework's files.
TEST(Structure, FrameworksOfCompatAreNamespaces) {
  std::map<std::string, std::set<std::string>> files;
  for (const auto& [file, target] : IncludesUnder("src/compat")) {
    const std::string framework = FrameworkOf(file.substr(4));
    if (framework.empty()) continue;
    files[framework].insert(file);
    const std::string included = FrameworkOf(target);
    EXPECT_TRUE(included.empty() || included == framework) << file << " includes " << target;
  }
  EXPECT_EQ(files.size(), std::size(kFrameworks));
  for (const auto& [framework, paths] : files) {
    const std::regex open("namespace tilegrad::compat::" + framework + "(::HWY_NAMESPACE)? \\{");
    EXPECT_GT(paths.size(), 2u);
    for (const std::string& path : paths) {
      EXPECT_TRUE(std::regex_search(ReadText(kRoot / path).value(), open)) << path;
    }
  }
}

TEST(Structure, ShadeSeesOnlyTheRecordsOfRaster) {
  const std::set<std::string> records = {"raster/screen_mesh.h", "raster/conventions.h"};
  for (const auto& [file, target] : IncludesUnder("src/shade")) {
    if (FirstPart(target) != "raster") continue;
    EXPECT_TRUE(records.count(target)) << file << " includes " << target;
  }
}

TEST(Structure, EachForeignLibraryHasOneHome) {
  // Library (first part of the include path) -> the only prefixes of files that may include it.
  const std::vector<std::pair<std::regex, std::vector<std::string>>> homes = {
      {std::regex("^(tbb|oneapi)/.*"), {"src/base/parallel.cc", "src/base/loop_team.cc"}},
      {std::regex("^hwy/.*"),
       {"src/base/", "src/raster/", "src/shade/", "src/nn/", "src/render/", "src/compat/",
        "src/rivals/"}},
      {std::regex("^glm/.*"),
       {"src/scene/", "src/raster/project", "src/io/", "src/train/", "src/fit/", "src/shade/",
        "src/render/picture/"}},
      {std::regex("^(tiny_gltf|stb_.*)\\.h$"), {"src/io/"}},
      {std::regex("^assimp/.*"), {"src/io/"}},
      {std::regex("^(zip|libdeflate)\\.h$"), {"src/io/"}},
      {std::regex("^matio\\.h$"), {"src/io/mat_"}},
      {std::regex("^Imf.*"), {"src/io/exr_"}},
      {std::regex("^webp/.*"), {"src/io/webp_", "src/io/image_readers.cc"}},
      {std::regex("^mpi\\.h$"), {"src/train/ranks/mpi_transport.cc"}},
      {std::regex("^(dlfcn|link)\\.h$"), {"src/base/own_binary.cc", "src/train/ranks/launch.cc"}},
      {std::regex("^Eigen/.*"), {"src/train/dense.cc", "src/fit/diffusion.cc"}},
      {std::regex("^toml\\+\\+.*"), {"src/train/", "src/fit/"}},
      {std::regex("^CLI/.*"), {"src/cli/command_line.cc"}},
      {std::regex("^(pybind11/.*|Python\\.h)$"), {"python/bindings/"}},
      {std::regex("^(fmt|nlohmann)/.*"), {"src/", "python/bindings/"}},
      {std::regex("^(sys/.*|(fcntl|malloc|poll|pthread|sched|signal|spawn|unistd)\\.h)$"),
       {"src/base/", "src/io/archive", "src/io/guarded_", "src/nn/memory", "src/cli/console",
        "src/fit/colmap_run.cc", "src/train/data/stream/mesh_cache.cc", "python/bindings/"}},
      {std::regex("^sanitizer/.*"), {"src/base/", "src/nn/memory"}},
  };
  auto includes = IncludesUnder("src");
  const auto bindings = IncludesUnder("python/bindings");
  ASSERT_FALSE(bindings.empty());
  includes.insert(includes.end(), bindings.begin(), bindings.end());
  for (const auto& [file, target] : includes) {
    bool known = FirstPart(target) == "tilegrad" || kMayInclude.count(FirstPart(target)) ||
                 FirstPart(target) == "bindings" ||
                 target.find_first_of("/.") == std::string::npos;  // the standard library
    for (const auto& [library, allowed] : homes) {
      if (!std::regex_match(target, library)) continue;
      known = true;
      bool home = false;
      for (const auto& prefix : allowed) home |= file.rfind(prefix, 0) == 0;
      EXPECT_TRUE(home) << file << " includes " << target << ", whose home is elsewhere";
    }
    EXPECT_TRUE(known) << file << " includes " << target << ", which has no home in this list";
  }
}

// Kernel x is x.h (contract), x_ref.h (truth), x-inl.h (vector body) and x.cc (dispatch). Missing
// file -> why.
const std::map<std::string, std::string> kKernelsWithoutFile = {
    {"src/base/array_checks-inl.h", "a loop of a few lines, in the .cc"},
    {"src/base/array_checks_ref.h", "std::isfinite and comparisons, in the test"},
    {"src/nn/kernels/conv2d/winograd_ref.h", "conv2d_ref.h: another way to the same convolution"},
    {"src/nn/kernels/product_adam_ref.h", "gemm_ref.h, then adam_ref.h"},
    {"src/raster/drawn_faces_ref.h", "visibility_ref.h, which tries every face"},
    {"src/raster/interpolate_backward_ref.h", "interpolate_ref.h has both directions"},
    {"src/raster/seen_faces_ref.h",
     "a numbering: gradients summed by it are held to interpolate_ref.h"},
    {"src/raster/soft_mask/soft_mask-inl.h", "forward-inl.h, backward-inl.h, tree-inl.h"},
};

TEST(Structure, AKernelIsASetOfFiles) {
  std::set<std::string> unused = Keys(kKernelsWithoutFile);
  int kernels = 0;
  for (const auto& [file, target] : IncludesUnder("src")) {
    if (target != "hwy/foreach_target.h") continue;
    ++kernels;
    ASSERT_TRUE(file.ends_with(".cc")) << file << " dispatches, but is no .cc";
    const std::string stem = file.substr(0, file.size() - 3);
    for (const char* part : {".h", "_ref.h", "-inl.h"}) {
      if (std::filesystem::exists(kRoot / (stem + part))) continue;
      EXPECT_TRUE(kKernelsWithoutFile.count(stem + part)) << stem << part << " is missing";
      unused.erase(stem + part);
    }
  }
  EXPECT_GT(kernels, 20);
  for (const auto& file : unused) ADD_FAILURE() << file << ": remove its exception";
}

TEST(Structure, PublicHeadersNeedOnlyTheStandardLibrary) {
  for (const auto& [file, target] : IncludesUnder("include")) {
    const bool own = FirstPart(target) == "tilegrad";
    const bool of_c =
        file == "include/tilegrad/c.h" && (target == "stddef.h" || target == "stdint.h");
    const bool standard =
        of_c || (target.find('/') == std::string::npos && target.find(".h") == std::string::npos);
    EXPECT_TRUE(own || standard) << file << " includes " << target;
  }
}

TEST(Structure, VersionIsWrittenTheSameEverywhere) {
  const std::string cmake = ReadText(kRoot / "CMakeLists.txt").value();
  EXPECT_NE(cmake.find("VERSION " TILEGRAD_VERSION), std::string::npos);
  EXPECT_NE(ReadText(kRoot / "CHANGELOG.md").value().find(TILEGRAD_VERSION), std::string::npos);
}

}  // namespace tilegrad::structure_test
