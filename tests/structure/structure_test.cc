// SPDX-License-Identifier: Apache-2.0
// Holds the tree to docs/architecture.md: who may include whom, and which foreign library lives
// where.
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "base/file.h"
#include "support/source_dir.h"
#include "tilegrad/version.h"

namespace tilegrad {
namespace {

const Path kRoot = TILEGRAD_SOURCE_DIR;

struct Include {
  std::string file;    // from the root, e.g. src/raster/bin.cc
  std::string target;  // as written between the quotes or brackets
};

std::vector<Include> IncludesUnder(const Path& folder) {
  static const std::regex pattern(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::vector<Include> out;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kRoot / folder)) {
    const std::string extension = entry.path().extension();
    if (extension != ".h" && extension != ".cc") continue;
    std::istringstream lines(ReadText(entry.path()).value());
    std::smatch match;
    for (std::string line; std::getline(lines, line);) {
      if (std::regex_search(line, match, pattern)) {
        out.push_back({std::filesystem::relative(entry.path(), kRoot).string(), match[1]});
      }
    }
  }
  return out;
}

std::string FirstPart(const std::string& path) { return path.substr(0, path.find('/')); }

// Folder -> folders of src/ it may include besides itself. Every folder may include tilegrad/ and
// the standard library.
const std::map<std::string, std::set<std::string>> kMayInclude = {
    {"base", {}},
    {"scene", {"base"}},
    {"nn", {"base"}},
    {"io", {"scene", "nn", "base"}},
    {"raster", {"scene", "base"}},
    {"shade", {"raster", "scene", "base"}},
    {"render", {"shade", "raster", "scene", "base"}},
    {"compat", {"render", "shade", "raster", "scene", "base"}},
    {"api", {"render", "shade", "raster", "scene", "base"}},
    {"train", {"render", "nn", "io", "scene", "base"}},
    {"fit", {"train", "render", "nn", "io", "scene", "base"}},
    {"proof", {"fit", "train", "render", "raster", "shade", "nn", "io", "scene", "base"}},
    {"cli", {"proof", "fit", "train", "render", "nn", "io", "scene", "base"}},
};

TEST(Structure, IncludesPointOneWay) {
  const auto includes = IncludesUnder("src");
  ASSERT_GT(includes.size(), 40u);  // the search itself works
  for (const auto& [file, target] : includes) {
    const std::string from = FirstPart(file.substr(4)), to = FirstPart(target);
    if (kMayInclude.count(to) == 0 || to == from) continue;
    EXPECT_TRUE(kMayInclude.at(from).count(to))
        << file << " includes " << target << ", but " << from << " may not include " << to;
  }
}

// The rules of other renderers stay out of ours: only bindings, benchmarks and tests include them.
TEST(Structure, NothingOfTheEngineIncludesCompat) {
  std::size_t seen = 0;
  for (const auto& [file, target] : IncludesUnder("src")) {
    if (FirstPart(target) != "compat") continue;
    ++seen;
    EXPECT_EQ(file.rfind("src/compat/", 0), 0u) << file << " includes " << target;
  }
  EXPECT_GT(seen, 20u);  // the search itself works
}

// A file of compat/x declares tilegrad::compat::x, and knows of no other framework's folder.
TEST(Structure, FoldersOfCompatAreNamespaces) {
  for (const char* framework : {"kaolin", "nvdiffrast", "pytorch3d"}) {
    const std::string folder = std::string("src/compat/") + framework;
    const std::string open = std::string("namespace tilegrad::compat::") + framework + " {";
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(kRoot / folder)) {
      ++files;
      EXPECT_NE(ReadText(entry.path()).value().find(open), std::string::npos) << entry.path();
    }
    EXPECT_GT(files, 2u);
    for (const auto& [file, target] : IncludesUnder(folder)) {
      if (FirstPart(target) != "compat" || target.rfind('/') == std::string("compat").size())
        continue;
      EXPECT_EQ(target.rfind(std::string("compat/") + framework + "/", 0), 0u)
          << file << " includes " << target;
    }
  }
}

TEST(Structure, ShadeSeesOnlyTheRecordsOfRaster) {
  const std::set<std::string> records = {"raster/fragments.h", "raster/screen_mesh.h",
                                         "raster/conventions.h"};
  for (const auto& [file, target] : IncludesUnder("src/shade")) {
    if (FirstPart(target) != "raster") continue;
    EXPECT_TRUE(records.count(target)) << file << " includes " << target;
  }
}

TEST(Structure, EachForeignLibraryHasOneHome) {
  // Library (first part of the include path) -> the only prefixes of files that may include it.
  const std::vector<std::pair<std::regex, std::vector<std::string>>> homes = {
      {std::regex("^(tbb|oneapi)/.*"), {"src/base/parallel.cc"}},
      {std::regex("^hwy/.*"),
       {"src/base/", "src/raster/", "src/shade/", "src/nn/", "src/render/", "src/compat/"}},
      {std::regex("^glm/.*"),
       {"src/scene/", "src/raster/project", "src/io/", "src/train/", "src/fit/", "src/shade/"}},
      {std::regex("^(tiny_gltf|stb_.*)\\.h$"), {"src/io/"}},
      {std::regex("^assimp/.*"), {"src/io/"}},
      {std::regex("^(zip|zlib)\\.h$"), {"src/io/"}},
      {std::regex("^Imf.*"), {"src/io/exr_"}},
      {std::regex("^toml\\+\\+.*"), {"src/train/", "src/fit/"}},
      {std::regex("^CLI/.*"), {"src/cli/"}},
      {std::regex("^(pybind11/.*|Python\\.h)$"), {"python/bindings/"}},
  };
  auto includes = IncludesUnder("src");
  const auto bindings = IncludesUnder("python/bindings");
  ASSERT_FALSE(bindings.empty());
  includes.insert(includes.end(), bindings.begin(), bindings.end());
  for (const auto& [file, target] : includes) {
    for (const auto& [library, allowed] : homes) {
      if (!std::regex_match(target, library)) continue;
      bool home = false;
      for (const auto& prefix : allowed) home |= file.rfind(prefix, 0) == 0;
      EXPECT_TRUE(home) << file << " includes " << target << ", whose home is elsewhere";
    }
  }
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

}  // namespace
}  // namespace tilegrad
