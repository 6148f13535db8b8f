// SPDX-License-Identifier: Apache-2.0
// Formats that Assimp reads, in a process of its own for each file: its importers may go wrong, but
// we do not. The first line of an input is the file's ending.
#include <algorithm>

#include "fuzz/target.h"
#include "io/mesh_file.h"
#include "io/mesh_samples.h"

namespace tilegrad::fuzz::assimp_targets {

void Assimp(Input input) {
  const auto end = std::find(input.begin(), input.end(), '\n');
  if (end == input.end() || end - input.begin() > 5) return;
  const std::string name = "a." + std::string(input.begin(), end);
  if (name.find('/') != std::string::npos || name.find('\0') != std::string::npos) return;
  const Input file = input.subspan(static_cast<std::size_t>(end - input.begin()) + 1);
  const MemorySource source(name, file);
  const auto loaded = io::LoadMesh(source, name);
  if (!Accepted(loaded)) return;
  Require(Validate(loaded->mesh).ok(), "a mesh that was read is valid");
  Require(!loaded->mesh.faces.empty(), "a mesh that was read has a face");
}

std::vector<Bytes> Seeds() {
  std::vector<Bytes> out;
  for (const io::MeshSample& sample : io::MakeMeshSamples(ScratchFolder())) {
    const std::string ending = sample.name.substr(sample.name.rfind('.') + 1);
    out.push_back(ToBytes(ending + "\n" + std::string(sample.bytes.begin(), sample.bytes.end())));
  }
  return out;
}

const Registration kTarget({"assimp", Assimp, Seeds, nullptr, 40});

}  // namespace tilegrad::fuzz::assimp_targets
