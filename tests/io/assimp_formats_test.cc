// SPDX-License-Identifier: Apache-2.0
// Each format that Assimp reads for us: a sound file gives its mesh, a damaged one an error or a
// valid mesh.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/rng.h"
#include "io/mesh_file.h"
#include "io/mesh_readers.h"
#include "io/mesh_samples.h"
#include "support/temp_folder.h"

namespace tilegrad::io::assimp_formats_test {

class AssimpFormatsTest : public TempFolderTest {};

std::array<float, 3> SortedExtents(const Mesh& mesh) {
  const Bounds b = MeshBounds(mesh);
  std::array<float, 3> extents = {b.high.x - b.low.x, b.high.y - b.low.y, b.high.z - b.low.z};
  std::sort(extents.begin(), extents.end());
  return extents;
}

TEST_F(AssimpFormatsTest, SoundFilesAreRead) {
  for (const MeshSample& sample : MakeMeshSamples(folder_)) {
    SCOPED_TRACE(sample.name);
    const auto loaded = LoadMesh(Write(sample.name, sample.bytes));
    EXPECT_TRUE(loaded.ok()) << loaded.status().message();
    if (!loaded.ok()) continue;
    const Mesh& mesh = loaded->mesh;
    EXPECT_EQ(mesh.faces.size(), 4u);
    EXPECT_EQ(mesh.positions.size(), 4u);
    EXPECT_TRUE(loaded->warnings.empty()) << loaded->warnings[0];
    const auto extents = SortedExtents(mesh);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(extents[i], 1 + i, 1e-5);
    // Have no materials, or none with a colour.
    if (sample.name.ends_with(".stl") || sample.name.ends_with(".md2")) continue;
    const glm::vec4 color = mesh.materials[mesh.face_materials[0]].base_color;
    const glm::vec4 want(0.8f, 0.2f, 0.4f, 1);
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(color[c], want[c], 1.0 / 255);  // 3DS, 3MF hold bytes
  }
}

TEST_F(AssimpFormatsTest, WhatStopsTheReaderIsAnErrorWithTheFilesName) {
  GuardLimits limits;
  limits.wall_seconds = 0;
  const Bytes file = Bytes(100, 0);
  ExpectMessage(ReadByAssimp(*OpenFolder(folder_), "a.FBX", file, limits).status(), "a.FBX",
                "the .fbx reader took more than 0 s");
}

TEST_F(AssimpFormatsTest, FacesWithoutIndicesAreLeftOut) {
  const auto loaded = LoadMesh(Write("a.x",
                                     "xof 0303txt 0032\nMesh t {\n"
                                     "4;\n0;0;0;,1;0;0;,0;2;0;,0;0;3;;\n"
                                     "3;\n3;0,2,1;,0;,3;0,1,3;;\n}\n"));
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->mesh.faces.size(), 2u);
}

TEST_F(AssimpFormatsTest, UnknownEndingsNameTheKnownOnes) {
  ExpectMessage(LoadMesh(Write("a.max", "x")).status(), "a.max", "\".max\"", ".glb, .gltf, .obj",
                ".fbx", ".ms3d", ".md2");
}

// Damage as transfers, editors and people cause it: bytes change, vanish, repeat, become extreme.
Bytes Damage(Bytes bytes, Rng& rng) {
  const auto place = [&] { return static_cast<std::ptrdiff_t>(rng.Below(bytes.size())); };
  for (std::uint64_t rounds = 1 + rng.Below(4); rounds > 0 && bytes.size() > 8; --rounds) {
    const std::ptrdiff_t at = place();
    const auto length = static_cast<std::ptrdiff_t>(
        std::min<std::uint64_t>(1 + rng.Below(40), bytes.size() - static_cast<std::size_t>(at)));
    const auto begin = bytes.begin() + at, end = begin + length;
    switch (rng.Below(7)) {
      case 0:
        *begin = static_cast<std::uint8_t>(rng.Next());
        break;
      case 1:
        *begin ^= static_cast<std::uint8_t>(1u << rng.Below(8));
        break;
      case 2:
        bytes.erase(begin, end);
        break;
      case 3: {
        const Bytes piece(begin, end);
        bytes.insert(bytes.begin() + place(), piece.begin(), piece.end());
        break;
      }
      case 4:
        std::fill(begin, begin + std::min<std::ptrdiff_t>(4, length), rng.Below(2) * 255);
        break;
      case 5: {  // a number of a text
        const auto digit = std::find_if(begin, bytes.end(), [](int c) { return std::isdigit(c); });
        const std::array<std::string, 4> numbers = {"-1", "4294967295", "1e39", "99999999"};
        const std::string& number = numbers[rng.Below(4)];
        bytes.insert(digit, number.begin(), number.end());
        break;
      }
      default:
        bytes.resize(std::max<std::size_t>(1, rng.Below(bytes.size())));
        break;
    }
  }
  return bytes;
}

// How often each thing happened to damaged copies of the samples.
struct Tally {
  int meshes = 0, errors = 0, stopped = 0;  // stopped: the reader crashed or ran into a limit
};

Tally ReadDamaged(const std::vector<MeshSample>& samples, const FileSource& folder, int copies,
                  std::uint64_t seed) {
  GuardLimits limits;
  limits.cpu_seconds = 1;
  limits.memory_bytes = std::size_t{512} << 20;
  Tally tally;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    Rng rng(seed, s);
    for (int i = 0; i < copies; ++i) {
      const auto loaded =
          ReadByAssimp(folder, samples[s].name, Damage(samples[s].bytes, rng), limits);
      if (loaded.ok()) {  // numbers that are not finite are LoadMesh's to find
        ++(Validate(loaded->mesh).ok() ? tally.meshes : tally.errors);
        continue;
      }
      const std::string message = loaded.status().message();
      EXPECT_NE(message.find(samples[s].name), std::string::npos) << message;
      ++(message.find(" reader ") == std::string::npos ? tally.errors : tally.stopped);
    }
  }
  return tally;
}

void DamagedFilesAreErrorsOrMeshes(const Path& folder, int copies) {
  constexpr std::uint64_t kSeed = 20190423;
  const auto samples = MakeMeshSamples(folder);
  const Tally tally = ReadDamaged(samples, *OpenFolder(folder), copies, kSeed);
  EXPECT_GT(tally.meshes, copies);
  EXPECT_GT(tally.errors, copies);
  testing::Test::RecordProperty("meshes", tally.meshes);
  testing::Test::RecordProperty("errors", tally.errors);
  testing::Test::RecordProperty("stopped", tally.stopped);
}

TEST_F(AssimpFormatsTest, DamagedFiles) { DamagedFilesAreErrorsOrMeshes(folder_, 40); }

TEST_F(AssimpFormatsTest, DamagedFilesLong) { DamagedFilesAreErrorsOrMeshes(folder_, 1000); }

}  // namespace tilegrad::io::assimp_formats_test
