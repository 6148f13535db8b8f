// SPDX-License-Identifier: Apache-2.0
// The checks of extremes_test.cc without an end: counts scenes, violations and
// the largest errors into a file, and goes on from there (`./run prove`). A scene is a pure
// function of its number; `prove --scene N` runs that one alone, on every target.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/simd_target.h"
#include "raster/extremes/bound_check.h"
#include "raster/extremes/truth.h"

namespace tilegrad::test {
namespace {

constexpr std::uint64_t kFirst = 1000000000;  // scenes below are those of tests
constexpr std::uint64_t kChunk = 500;         // on one target, then the tally is written
constexpr std::size_t kHeapFaces = 300;

struct Arguments {
  double seconds = 60;
  int threads = 1;
  Path state = "out/prove/tally.txt";
  std::uint64_t scene = 0;  // this one alone, if not 0
};

// Of scenes of one kind, or a sum of such.
struct ProofRow {
  std::uint64_t scenes = 0, numbers = 0;  // numbers: that were compared
  std::uint64_t violations = 0;           // scenes with one
  double ratio = 0;                       // largest error / what is allowed
  double share = 0;                       // largest error beyond rounding / E

  void Add(const ProofRow& other) {
    scenes += other.scenes;
    numbers += other.numbers;
    violations += other.violations;
    ratio = std::max(ratio, other.ratio);
    share = std::max(share, other.share);
  }
};

// What has been counted so far, as a file that a later run goes on from.
struct ProofTally {
  std::uint64_t next = 0;  // the scene to go on with
  // By the check, and for alpha the decades of delta and of faces.
  std::map<std::pair<std::string, std::string>, ProofRow> rows;
  std::vector<std::string> violations;  // a line each; the first thousand

  void Add(const ProofTally& other) {
    for (const auto& [key, row] : other.rows) rows[key].Add(row);
    for (const std::string& line : other.violations) {
      if (violations.size() < 1000) violations.push_back(line);
    }
  }
  ProofRow Sum() const {
    ProofRow out;
    for (const auto& [key, row] : rows) out.Add(row);
    return out;
  }
};

constexpr const char* kFirstLine = "tilegrad prove 1";

Status ReadLine(const std::string& line, ProofTally* tally) {
  std::istringstream in(line);
  std::string word;
  in >> word;
  if (word == "next") {
    in >> tally->next;
  } else if (word == "violation") {
    std::getline(in >> std::ws, word);
    tally->violations.push_back(word);
  } else {
    std::string group;
    ProofRow row;
    in >> group >> row.scenes >> row.numbers >> row.violations >> row.ratio >> row.share;
    tally->rows[{word, group}] = row;
  }
  return in.fail() ? DataLoss("\"{}\" is no line of a tally", line) : Status();
}

// For people.
std::string ProofTable(const ProofTally& tally) {
  std::string out =
      "| check | scenes of | scenes | numbers | violations | largest error / allowed | largest "
      "error / E |\n|---|---|--:|--:|--:|--:|--:|\n";
  const auto add = [&](const std::string& check, const std::string& group, const ProofRow& row) {
    out += fmt::format("| {} | {} | {} | {} | {} | {:.3g} | {:.3g} |\n", check, group, row.scenes,
                       row.numbers, row.violations, row.ratio, row.share);
  };
  for (const auto& [key, row] : tally.rows) add(key.first, key.second, row);
  add("all", "", tally.Sum());
  return out;
}

// An empty tally if there is no file.
Result<ProofTally> ReadTally(const Path& file) {
  ProofTally tally;
  if (!std::filesystem::exists(file)) return tally;
  const auto text = ReadText(file);
  if (!text.ok()) return text.status();
  std::istringstream lines(*text);
  std::string line;
  if (!std::getline(lines, line) || line != kFirstLine) {
    return DataLoss("{}: not a tally of this program (first line \"{}\")", file.string(),
                    kFirstLine);
  }
  while (std::getline(lines, line)) {
    if (const Status status = ReadLine(line, &tally); !status.ok()) {
      return DataLoss("{}: {}", file.string(), status.message());
    }
  }
  return tally;
}

// Whole or not at all.
Status WriteTally(const Path& file, const ProofTally& tally) {
  std::string out = fmt::format("{}\nnext {}\n", kFirstLine, tally.next);
  for (const auto& [key, row] : tally.rows) {
    out += fmt::format("{} {} {} {} {} {} {}\n", key.first, key.second, row.scenes, row.numbers,
                       row.violations, row.ratio, row.share);
  }
  for (const std::string& line : tally.violations) out += "violation " + line + "\n";
  return WriteTextAtomic(file, out);
}

std::string Decades(double value, const char* name) {
  const int decade = static_cast<int>(std::floor(std::log10(value)));
  return fmt::format("{}:1e{}..1e{}", name, decade, decade + 1);
}

// One in five is of the extremes; of the others one in 200 is large.
void CheckAlpha(std::uint64_t number, Renderer* renderer, ProofTally* tally) {
  double delta = 1;
  const double decades = number % 200 == 1 ? 4 : 1.3;
  const BoundSummary found = CheckBoundScene({number, decades}, renderer, &delta);
  const double faces = static_cast<double>(std::max<std::size_t>(found.faces, 1));
  const std::string group = Decades(delta, "delta") + "," + Decades(faces, "faces");
  tally->rows[{"alpha", group}].Add(
      {1, found.pixels, found.Kept() ? 0u : 1u, found.of_reported, found.share});
  if (found.Kept()) return;
  tally->violations.push_back(fmt::format(
      "scene {} on {}: beyond E {}, beyond what was reported {}, reported beyond E {}, order {} {}",
      number, ActiveTarget(), found.over_budget, found.over_spent, found.spent_over, found.order,
      found.failed));
}

void CheckExtremes(std::uint64_t number, Renderer* renderer, ProofTally* tally) {
  CheckCounts counts;
  const ExtremeScene scene = MakeExtremeScene(number, kHeapFaces);
  const std::string wrong = CheckExtremeScene(scene, number, renderer, &counts);
  std::string kind = scene.kind;
  for (char& c : kind) c = c == ' ' ? '-' : c;
  tally->rows[{"extremes", kind}].Add(
      {1, counts.compared, wrong.empty() ? 0u : 1u, counts.worst, 0});
  if (wrong.empty()) return;
  tally->violations.push_back(
      fmt::format("scene {} ({}) on {}: {}", number, scene.kind, ActiveTarget(), wrong));
}

void CheckScene(std::uint64_t number, Renderer* renderer, ProofTally* tally) {
  number % 5 == 0 ? CheckExtremes(number, renderer, tally) : CheckAlpha(number, renderer, tally);
}

// Chunks take the machine's targets in turn.
Status CheckChunk(const Workers& workers, std::vector<Renderer>& renderers, ProofTally* tally) {
  const std::vector<std::string> targets = RunnableTargets();
  const TargetScope scope(targets[tally->next / kChunk % targets.size()]);
  if (!scope.status().ok()) return scope.status();
  std::vector<ProofTally> scenes(kChunk);
  workers.For(kChunk, [&](std::size_t n, std::size_t w) {
    CheckScene(kFirst + tally->next + n, &renderers[w], &scenes[n]);
  });
  for (const ProofTally& scene : scenes) tally->Add(scene);
  tally->next += kChunk;
  return {};
}

int Fail(const Status& status) {
  fmt::print(stderr, "prove: {}\n", status.message());
  return 1;
}

int End(const ProofTally& tally) {
  fmt::print("{}", ProofTable(tally));
  for (const std::string& line : tally.violations) fmt::print("VIOLATION {}\n", line);
  return tally.Sum().violations == 0 ? 0 : 1;
}

int RunOne(std::uint64_t number) {
  const Workers one(1);
  Renderer renderer = RendererOn(one);
  ProofTally tally;
  for (const std::string& target : RunnableTargets()) {
    const TargetScope scope(target);
    CheckScene(number, &renderer, &tally);
  }
  return End(tally);
}

int Run(const Arguments& arguments) {
  auto read = ReadTally(arguments.state);
  if (!read.ok()) return Fail(read.status());
  ProofTally tally = *std::move(read);
  const Workers workers(arguments.threads), one(1);
  std::vector<Renderer> renderers;
  for (int w = 0; w < workers.count(); ++w) renderers.push_back(RendererOn(one));
  const auto start = std::chrono::steady_clock::now();
  const std::chrono::duration<double> most(arguments.seconds);
  while (std::chrono::steady_clock::now() - start < most) {
    Status status = CheckChunk(workers, renderers, &tally);
    if (status.ok()) status = WriteTally(arguments.state, tally);
    if (!status.ok()) return Fail(status);
  }
  return End(tally);
}

int Main(int count, char** values) {
  Arguments out;
  for (int i = 1; i + 1 < count; i += 2) {
    const std::string name = values[i], value = values[i + 1];
    if (name == "--seconds") out.seconds = std::atof(value.c_str());
    if (name == "--threads") out.threads = std::atoi(value.c_str());
    if (name == "--state") out.state = value;
    if (name == "--scene") out.scene = std::strtoull(value.c_str(), nullptr, 10);
  }
  if (count % 2 == 0 || !(out.seconds > 0)) {
    fmt::print(stderr, "usage: prove [--seconds S] [--threads N] [--state FILE] [--scene N]\n");
    return 2;
  }
  return out.scene != 0 ? RunOne(out.scene) : Run(out);
}

}  // namespace
}  // namespace tilegrad::test

int main(int count, char** values) { return tilegrad::test::Main(count, values); }
