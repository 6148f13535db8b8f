// SPDX-License-Identifier: Apache-2.0
// Internal to io: the numbers of a PLY file's body.
#pragma once

#include <string_view>
#include <vector>

#include "io/ply_header.h"

namespace tilegrad::io {

// One after the other, however they are written.
class PlyValues {
 public:
  PlyValues(std::string_view data, PlyHeader::Encoding encoding)
      : rest_(data),
        text_(encoding == PlyHeader::Encoding::kText),
        swap_(encoding == PlyHeader::Encoding::kBigEndian) {}

  // False if the data ends or is no number; it need not be a finite one.
  bool Next(PlyType type, double& value);
  // A list of finite numbers. Its length is held against what is left before memory is taken.
  bool NextList(const PlyProperty& property, std::vector<double>& list);
  // Passes over a number or a list, whatever it holds. False if the data ends.
  bool Skip(const PlyProperty& property);

 private:
  // The length of a list, which the data that is left can hold.
  bool NextLength(const PlyProperty& property, std::size_t& length);

  std::string_view rest_;
  bool text_, swap_;
};

}  // namespace tilegrad::io
