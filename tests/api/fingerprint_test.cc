// SPDX-License-Identifier: Apache-2.0
// The bits of everything that the public interface computes, on every SIMD target that the machine
// has and of the reference in double, beside hashes that tests/api/fingerprints.txt holds. Other
// tests allow roundings, so that numbers may move within them unseen; here nothing moves unseen.
//
//   TILEGRAD_WRITE_FINGERPRINTS=1 build/release/tests/api/api_fingerprint_test
//
// writes the file anew, for the targets of this machine. A change of these numbers needs a reason
// in the commit message.
//
// Targets are forced in Highway itself, whose shared library is the engine's, too: so nothing is
// needed but public headers. With -ffp-contract=off, one target should give the same bits on every
// machine, but for what the C library makes of exp and log, which may be off by a rounding. Where
// that is not what it was when the file was written, the reference is skipped.
#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <tilegrad/tilegrad.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "api/variants.h"
#include "support/source_dir.h"

namespace tilegrad::test::fingerprint_test {

const std::string kFile = TILEGRAD_SOURCE_DIR "/tests/api/fingerprints.txt";
const std::string kReference = "double";  // the target of RendererT<double>

bool Writing() { return std::getenv("TILEGRAD_WRITE_FINGERPRINTS") != nullptr; }

// FNV-1a of 64 bits.
class Fnv {
 public:
  template <class T>
  void Add(std::span<const T> values) {
    for (const std::byte byte : std::as_bytes(values)) {
      hash_ = (hash_ ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3u;
    }
  }
  std::uint64_t hash() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

// Of arrays by name. An array goes on where one of the same name was before.
class Hashes {
 public:
  template <class T>
  void Add(const std::string& name, std::span<const T> values) {
    if (!values.empty()) arrays_[name].Add(values);
  }
  template <class T>
  void AddAll(const NamedNumbers<T>& numbers) {
    for (const auto& [name, values] : numbers) Add(name, std::span<const T>(values));
  }
  // Of all arrays, and their names.
  std::string Text() const {
    Fnv all;
    for (const auto& [name, array] : arrays_) {
      const std::uint64_t hash = array.hash();
      all.Add(std::span<const char>(name));
      all.Add(std::span<const std::uint64_t>(&hash, 1));
    }
    std::ostringstream out;
    out << std::hex << std::setw(16) << std::setfill('0') << all.hash();
    return out.str();
  }

 private:
  std::map<std::string, Fnv> arrays_;
};

// A row for each case, a column for each target.
struct Table {
  std::vector<std::string> targets;
  std::map<std::string, std::map<std::string, std::string>> rows;  // by name and target

  static Table Read() {
    Table table;
    std::ifstream file(kFile);
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      std::string name, word;
      words >> name;
      if (name == "#") continue;
      for (std::size_t i = 0; words >> word; ++i) {
        if (name == "case") table.targets.push_back(word);
        if (name != "case" && word != "-") table.rows[name][table.targets.at(i)] = word;
      }
    }
    return table;
  }
  void Write() const {
    std::ofstream file(kFile);
    file << "# Hashes of the bits of images and gradients of the variants of variants.h, by "
            "target;\n# \"double\" is the scalar reference, - none. Written by "
            "fingerprint_test.cc: a change needs a\n# reason in the commit message.\ncase";
    for (const std::string& target : targets) file << ' ' << target;
    for (const auto& [name, hashes] : rows) {
      file << '\n' << name;
      for (const std::string& target : targets) {
        const auto hash = hashes.find(target);
        file << ' ' << (hash == hashes.end() ? "-" : hash->second);
      }
    }
    EXPECT_TRUE(file << std::endl) << kFile;
  }
  bool Has(const std::string& target) const {
    return std::find(targets.begin(), targets.end(), target) != targets.end();
  }
};

using Fingerprint = std::map<std::string, std::string>;  // rows of a target

// A small image; or three of several bins and bands, of one mesh from three sides.
template <class T>
std::string RunCase(const Variant& variant, bool large, RendererT<T>* renderer, FrameT<T>* frame) {
  VariantScene<T> v(variant);
  std::vector<SceneT<T>> scenes(large ? 3 : 1, v.s.scene);
  for (std::size_t n = 0; n < scenes.size() && large; ++n) {
    scenes[n].camera.fx = scenes[n].camera.fy = T(160);
    scenes[n].camera.cx = T(90 + 10 * static_cast<int>(n));
    scenes[n].camera.cy = T(80);
    v.options.width = 180;
    v.options.height = 160;
    v.options.culling = FaceCulling::kBack;
  }
  Hashes hashes;
  hashes.AddAll(NumbersOf<T>(v, scenes, renderer, frame));
  hashes.Add("face_ids", frame->images().face_ids);
  hashes.Add("alpha_error_bound", std::span<const double>(&frame->images().alpha_error_bound, 1));
  return hashes.Text();
}

template <class T>
Fingerprint RunAll(const Variant& variant, int threads, FrameT<T>* frame) {
  RendererT<T> renderer({.threads = threads});
  return {{variant.name, RunCase(variant, false, &renderer, frame)},
          {variant.name + "/large", RunCase(variant, true, &renderer, frame)}};
}

// Of the C library, not of tilegrad.
std::string HashOfLibm() {
  Hashes hashes;
  for (int i = 1; i < 4000; ++i) {
    const double x = i / 256.0;
    const double values[] = {std::exp(-x), std::log(x), std::exp2(-x), std::log2(x),
                             std::sin(x),  std::cos(x), std::tan(x)};
    hashes.Add("values", std::span<const double>(values));
  }
  return hashes.Text();
}

// Makes kernels use one target, the best one if it is 0.
void Force(std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

std::vector<std::string> Targets() {
  std::vector<std::string> out;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    out.emplace_back(hwy::TargetName(target));
  }
  out.push_back(kReference);
  return out;
}

void ForceByName(const std::string& name) {
  Force(0);
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    if (name == hwy::TargetName(target)) return Force(target);
  }
}

class ApiFingerprint : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() { table_ = Table::Read(); }
  static void TearDownTestSuite() {
    if (Writing()) table_.Write();
  }
  void SetUp() override { ForceByName(target_); }
  void TearDown() override { Force(0); }

  // Why there is nothing to compare with; empty if there is.
  std::string WhyNot() const {
    if (Writing()) return "";
    if (!table_.Has(target_)) return "fingerprints.txt has no hashes of " + target_;
    if (target_ != kReference || HashOfLibm() == table_.rows["libm"][kReference]) return "";
    return "fingerprints.txt was made with another C library, whose exp and log differ";
  }

  void Check(const Fingerprint& got) {
    for (const auto& [name, hash] : got) {
      std::string& expected = table_.rows[name][target_];
      if (Writing()) expected = hash;
      EXPECT_EQ(hash, expected) << "bits of " << name << " on " << target_
                                << " are not those of fingerprints.txt";
    }
  }

  // With one thread and a frame that is new, and with two and one that was used before: neither may
  // matter.
  template <class T>
  void CheckAll() {
    FrameT<T> used;
    for (const Variant& variant : kVariants) {
      FrameT<T> fresh;
      const Fingerprint alone = RunAll(variant, 1, &fresh);
      EXPECT_EQ(alone, RunAll(variant, 2, &used)) << "bits on " << target_ << " depend on threads";
      Check(alone);
    }
  }

  const std::string target_ = GetParam();
  static inline Table table_;
};

TEST_P(ApiFingerprint, BitsAreThoseOfTheFile) {
  if (const std::string why = WhyNot(); !why.empty()) {
    std::cerr << "skipped: " << why << "\n";  // --gtest_brief does not show it
    GTEST_SKIP() << why;
  }
  if (Writing() && !table_.Has(target_)) table_.targets.push_back(target_);
  if (target_ != kReference) return CheckAll<float>();
  CheckAll<double>();
  Check({{"libm", HashOfLibm()}});
}

INSTANTIATE_TEST_SUITE_P(Targets, ApiFingerprint, testing::ValuesIn(Targets()),
                         [](const auto& target) { return target.param; });

}  // namespace tilegrad::test::fingerprint_test
