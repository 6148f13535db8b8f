// SPDX-License-Identifier: Apache-2.0
// Internal to io: which properties of a PLY element are read.
#pragma once

#include <array>
#include <initializer_list>
#include <vector>

#include "io/ply_header.h"

namespace tilegrad::io {

bool IsPlyIndices(const PlyProperty& property);

// A place, a normal, a colour or a uv without all of its numbers is none.
struct PlyColumns {
  // Of faces (to kAlpha) and of vertices (from kRed).
  enum Slot { kTexNumber, kRed, kGreen, kBlue, kAlpha, kX, kY, kZ, kNx, kNy, kNz, kU, kV, kSlots };
  struct Column {
    Slot slot = kSlots;  // of a number that is read
    bool list = false;   // that is read
    double scale = 1;
  };

  // Numbers from `first` up to `end` are read.
  PlyColumns(const PlyElement& element, Slot first, Slot end);

  std::vector<Column> of;  // each property
  std::array<bool, kSlots> has{};

 private:
  static Column ColumnOf(const PlyProperty& property);
  void NeedAll(std::initializer_list<Slot> slots);
};

}  // namespace tilegrad::io
