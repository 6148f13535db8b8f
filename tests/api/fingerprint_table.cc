// SPDX-License-Identifier: Apache-2.0
#include "api/fingerprint_table.h"

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <sstream>

namespace tilegrad::test {
namespace {

constexpr const char* kHead =
    "# Hashes of the bits of images (name) and gradients (d_name) of the cases of\n"
    "# fingerprint_cases.cc, by target; \"double\" is the scalar reference. = is the hash to the\n"
    "# left, - none. Written by fingerprint_test.cc: a change needs a reason in the commit "
    "message.\n";

const std::string kColumns = "case array";  // how the line of targets begins

std::string Hexadecimal(std::uint64_t hash) {
  std::ostringstream out;
  out << std::hex << std::setw(16) << std::setfill('0') << hash;
  return out.str();
}

}  // namespace

FingerprintTable FingerprintTable::Read(const std::string& path) {
  FingerprintTable table;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (!line.starts_with(kColumns)) {
      table.ReadRow(line);
      continue;
    }
    std::istringstream words(line.substr(kColumns.size()));
    for (std::string target; words >> target;) table.targets_.push_back(target);
  }
  return table;
}

void FingerprintTable::ReadRow(const std::string& line) {
  std::istringstream words(line);
  std::string name, array, word, left;
  words >> name >> array;
  for (const std::string& target : targets_) {
    words >> word;
    if (word == "-") continue;
    if (word != "=") left = word;
    rows_[name][array][target] = std::stoull(left, nullptr, 16);
  }
}

std::string FingerprintTable::Row(const std::map<std::string, std::uint64_t>& hashes) const {
  std::string out, left;
  for (const std::string& target : targets_) {
    const auto at = hashes.find(target);
    std::string hash = at == hashes.end() ? "-" : Hexadecimal(at->second);
    out += ' ' + (hash == left && hash != "-" ? "=" : hash);
    if (hash != "-") left = std::move(hash);
  }
  return out;
}

bool FingerprintTable::Write(const std::string& path) const {
  std::ofstream file(path);
  file << kHead << kColumns;
  for (const std::string& target : targets_) file << ' ' << target;
  file << '\n';
  for (const auto& [name, arrays] : rows_) {
    for (const auto& [array, hashes] : arrays) {
      if (!hashes.empty()) file << name << ' ' << array << Row(hashes) << '\n';
    }
  }
  return static_cast<bool>(file.flush());
}

bool FingerprintTable::HasTarget(const std::string& target) const {
  return std::find(targets_.begin(), targets_.end(), target) != targets_.end();
}

Fingerprint FingerprintTable::Get(const std::string& target, const std::string& name) const {
  Fingerprint out;
  const auto arrays = rows_.find(name);
  if (arrays == rows_.end()) return out;
  for (const auto& [array, hashes] : arrays->second) {
    if (const auto at = hashes.find(target); at != hashes.end()) out[array] = at->second;
  }
  return out;
}

void FingerprintTable::Set(const std::string& target, const std::string& name,
                           const Fingerprint& fingerprint) {
  if (!HasTarget(target)) targets_.push_back(target);
  for (const auto& [array, hash] : fingerprint) rows_[name][array][target] = hash;
}

void FingerprintTable::Forget(const std::string& target) {
  for (auto& [name, arrays] : rows_) {
    for (auto& [array, hashes] : arrays) hashes.erase(target);
  }
}

}  // namespace tilegrad::test
