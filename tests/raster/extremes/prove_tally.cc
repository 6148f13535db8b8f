// SPDX-License-Identifier: Apache-2.0
#include "raster/extremes/prove_tally.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "base/error.h"

namespace tilegrad::test {
namespace {

constexpr const char* kFirstLine = "tilegrad prove 1";
constexpr std::size_t kMostViolations = 1000;

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

}  // namespace

void ProofRow::Add(const ProofRow& other) {
  scenes += other.scenes;
  numbers += other.numbers;
  violations += other.violations;
  ratio = std::max(ratio, other.ratio);
  share = std::max(share, other.share);
}

void ProofTally::Add(const ProofTally& other) {
  for (const auto& [key, row] : other.rows) rows[key].Add(row);
  for (const std::string& line : other.violations) {
    if (violations.size() < kMostViolations) violations.push_back(line);
  }
}

ProofRow ProofTally::Sum() const {
  ProofRow out;
  for (const auto& [key, row] : rows) out.Add(row);
  return out;
}

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

Status WriteTally(const Path& file, const ProofTally& tally) {
  std::string out = fmt::format("{}\nnext {}\n", kFirstLine, tally.next);
  for (const auto& [key, row] : tally.rows) {
    out += fmt::format("{} {} {} {} {} {} {}\n", key.first, key.second, row.scenes, row.numbers,
                       row.violations, row.ratio, row.share);
  }
  for (const std::string& line : tally.violations) out += "violation " + line + "\n";
  return WriteTextAtomic(file, out);
}

}  // namespace tilegrad::test
