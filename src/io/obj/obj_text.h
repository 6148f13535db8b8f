// SPDX-License-Identifier: Apache-2.0
// Internal to io: the lines of OBJ and MTL files, and the names in them.
#pragma once

#include <string>
#include <string_view>

namespace tilegrad::io {

// Walks over statements: comments and empty lines are left out, lines that end with a backslash are
// joined with the next one. Lines end with \n, \r\n or \r. UTF-8's byte order mark is left out.
class ObjLines {
 public:
  explicit ObjLines(std::string_view text);

  // The keyword, and what follows it, without white space at the ends; valid until the next call.
  bool Next(std::string_view& keyword, std::string_view& rest);
  std::size_t Number() const { return number_; }  // of the statement's last line, from 1

 private:
  bool NextLine(std::string_view& line);

  std::string_view rest_;
  std::string joined_;
  std::size_t number_ = 0;
};

// The rest of a line as one name, which may contain spaces, without quotes around it.
std::string_view WholeName(std::string_view rest);

// What stands before " #", which begins a comment to some writers and belongs to the name for
// others: for names that are not found whole.
std::string_view WithoutComment(std::string_view name);

}  // namespace tilegrad::io
