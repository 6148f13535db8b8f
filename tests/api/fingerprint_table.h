// SPDX-License-Identifier: Apache-2.0
// The expected hashes, as the text file fingerprints.txt has them: a row for each array of each
// case, a column for each target.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace tilegrad::test {

using Fingerprint = std::map<std::string, std::uint64_t>;  // hashes by array

class FingerprintTable {
 public:
  // Empty where there is no such file.
  static FingerprintTable Read(const std::string& path);
  bool Write(const std::string& path) const;

  bool HasTarget(const std::string& target) const;
  // Empty if it has none.
  Fingerprint Get(const std::string& target, const std::string& name) const;
  void Set(const std::string& target, const std::string& name, const Fingerprint& fingerprint);
  void Forget(const std::string& target);

 private:
  void ReadRow(const std::string& line);
  std::string Row(const std::map<std::string, std::uint64_t>& hashes) const;

  std::vector<std::string> targets_;  // in the order of columns
  // By case, array and target.
  std::map<std::string, std::map<std::string, std::map<std::string, std::uint64_t>>> rows_;
};

}  // namespace tilegrad::test
