// SPDX-License-Identifier: Apache-2.0
// Every fuzz target without libFuzzer: over its seeds, which it accepts; over mutations of them;
// over the inputs in found/, each of which once broke something; and over corpus/.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "fuzz/numbers.h"
#include "fuzz/target.h"

namespace tilegrad::fuzz::replay_test {

// Bytes that change, go, come twice, or come from another place; or the end is missing.
Bytes Mutated(Bytes bytes, Rng* rng) {
  for (std::uint64_t n = 1 + rng->Below(4); n-- > 0 && !bytes.empty();) {
    const auto at = static_cast<std::ptrdiff_t>(rng->Below(bytes.size()));
    const auto left = static_cast<std::uint64_t>(bytes.size()) - static_cast<std::uint64_t>(at);
    const auto length =
        static_cast<std::ptrdiff_t>(1 + rng->Below(std::min<std::uint64_t>(left, 8)));
    switch (rng->Below(5)) {
      case 0:
        bytes[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(rng->Next());
        break;
      case 1:
        bytes[static_cast<std::size_t>(at)] ^= static_cast<std::uint8_t>(1u << rng->Below(8));
        break;
      case 2:
        bytes.erase(bytes.begin() + at, bytes.begin() + at + length);
        break;
      case 3:
        bytes.erase(bytes.begin() + at, bytes.end());
        break;
      default: {
        const Bytes part(bytes.begin() + at, bytes.begin() + at + length);
        const auto to = static_cast<std::ptrdiff_t>(rng->Below(bytes.size()));
        bytes.insert(bytes.begin() + to, part.begin(), part.end());
      }
    }
  }
  return bytes;
}

// What a target is given now; written to a file if it ends the program.
Input g_input;

extern "C" void KeepInput(int signal) {
  const std::string file = testing::TempDir() + "tilegrad_fuzz_broken";
  if (std::FILE* out = std::fopen(file.c_str(), "wb")) {
    std::fwrite(g_input.data(), 1, g_input.size(), out);
    std::fclose(out);
    std::fprintf(stderr, "the input that did it: %s\n", file.c_str());
  }
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void Feed(const Target& target, Input input) {
  for (const int signal : {SIGABRT, SIGSEGV, SIGFPE}) std::signal(signal, KeepInput);
  g_input = input;
  Run(target, input);
}

class Replay : public testing::TestWithParam<Target> {};

TEST_P(Replay, SeedsAndMutationsOfThem) {
  const Target& target = GetParam();
  const std::vector<Bytes> seeds = SeedsOf(target);
  ASSERT_FALSE(seeds.empty());
  Rng rng(20, 26);
  for (const Bytes& seed : seeds) {
    Feed(target, seed);
    const char* more = std::getenv("TILEGRAD_FUZZ_MUTATIONS");
    for (int n = more != nullptr ? std::atoi(more) : target.mutations; n-- > 0;) {
      Bytes bytes = Mutated(seed, &rng);
      if (target.repair != nullptr) target.repair(bytes);
      Feed(target, bytes);
    }
  }
}

TEST_P(Replay, WhatWasFound) {
  for (const char* kind : {"found", "corpus"}) {
    for (const Path& file : FilesIn(kind, GetParam().name)) {
      SCOPED_TRACE(file.string());
      const auto bytes = ReadFile(file);
      ASSERT_TRUE(bytes.ok()) << bytes.status().message();
      Feed(GetParam(), *bytes);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay, testing::ValuesIn(Targets()),
                         [](const auto& p) { return p.param.name; });

// Fits of random cameras, masks and settings. TILEGRAD_RANDOM_FITS=COUNT runs more of them,
// FIRST+COUNT those from a seed on.
void RunRandomFits(std::uint64_t count) {
  constexpr double kMostSeconds = 10;  // of processor time, each
  std::uint64_t seed = 1000;
  if (const char* set = std::getenv("TILEGRAD_RANDOM_FITS")) {
    char* end = nullptr;
    count = std::strtoull(set, &end, 10);
    if (*end == '+') {
      seed = count;
      count = std::strtoull(end + 1, nullptr, 10);
    }
  }
  const auto target = std::ranges::find(Targets(), std::string("fit"), &Target::name);
  ASSERT_NE(target, Targets().end());
  for (const std::uint64_t end = seed + count; seed < end; ++seed) {
    const Bytes bytes = RandomBytes(seed, 4000);
    const std::clock_t start = std::clock();
    Feed(*target, bytes);
    const double taken = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    EXPECT_LT(taken, kMostSeconds) << "seed " << seed;
  }
}

TEST(RandomFits, EndOrSayWhy) { RunRandomFits(60); }
TEST(RandomFits, LongListsEndOrSayWhy) { RunRandomFits(1000); }

// A folder of another name would never be looked at.
TEST(ReplayFolders, EachIsOfATarget) {
  for (const char* kind : {"seeds", "found", "corpus"}) {
    for (const Path& folder : FilesIn(kind, "")) {
      EXPECT_TRUE(std::any_of(Targets().begin(), Targets().end(), [&](const Target& t) {
        return t.name == folder.filename();
      })) << folder;
    }
  }
}

}  // namespace tilegrad::fuzz::replay_test
