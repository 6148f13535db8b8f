// SPDX-License-Identifier: Apache-2.0
// libFuzzer's side of one target: TILEGRAD_FUZZ_TARGET is its name.
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "fuzz/target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

namespace tilegrad::fuzz {
namespace {

const Target& ThisTarget() {
  static const Target& target = []() -> const Target& {
    for (const Target& t : Targets()) {
      if (t.name == TILEGRAD_FUZZ_TARGET) return t;
    }
    std::fprintf(stderr, "no target %s\n", TILEGRAD_FUZZ_TARGET);
    std::abort();
  }();
  return target;
}

void WriteSeeds(const Path& folder) {
  std::filesystem::create_directories(folder);
  int n = 0;
  for (const Bytes& seed : SeedsOf(ThisTarget())) {
    std::ofstream(folder / ("seed" + std::to_string(n++)), std::ios::binary)
        .write(reinterpret_cast<const char*>(seed.data()), static_cast<long>(seed.size()));
  }
}

}  // namespace
}  // namespace tilegrad::fuzz

// TILEGRAD_FUZZ_SEEDS=FOLDER: writes the seeds, and ends.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* folder = std::getenv("TILEGRAD_FUZZ_SEEDS")) {
    tilegrad::fuzz::WriteSeeds(folder);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tilegrad::fuzz::Run(tilegrad::fuzz::ThisTarget(), {data, size});
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  size = LLVMFuzzerMutate(data, size, most);
  const auto repair = tilegrad::fuzz::ThisTarget().repair;
  if (repair != nullptr && seed % 8 != 0) repair({data, size});  // one in eight stays broken
  return size;
}
