// SPDX-License-Identifier: Apache-2.0
// Text: case, plurals, percent-encoding, UTF-8, escaping.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace tilegrad {

// Lower-cases ASCII letters; for comparing formats and file name extensions.
std::string LowerCase(std::string_view text);

// "file" if `one`, else "files"; "class", "classes".
std::string Plural(std::string_view thing, bool one);
// "1 file", "2 files".
template <std::integral Number>
std::string Count(Number number, std::string_view thing) {
  return std::to_string(number) + " " + Plural(thing, number == 1);
}

// Makes names unique: the second "chair" becomes "chair_2".
class UniqueNames {
 public:
  // `name`, or if taken the first free one of name_2, name_3, ...; taken from now on.
  std::string Take(const std::string& name) {
    std::string unique = name;
    for (int i = 2; !taken_.insert(unique).second; ++i) unique = name + "_" + std::to_string(i);
    return unique;
  }

 private:
  std::set<std::string> taken_;
};

// "my%20wood.png" -> "my wood.png" (RFC 3986). A "+" stays, and so does a "%" without two
// hexadecimal digits after it.
std::string DecodePercent(std::string_view uri);

// Appends a Unicode code point as UTF-8; U+FFFD for invalid ones (surrogates, above U+10FFFF).
void AppendUtf8(std::uint32_t character, std::string* out);

// Decodes the first character of a non-empty text: its length in bytes; 1, with `valid` false, if
// the bytes are not UTF-8.
struct Utf8Character {
  std::uint32_t code = 0;
  std::size_t bytes = 1;
  bool valid = false;
};
Utf8Character FirstCharacter(std::string_view text);

bool IsUtf8(std::string_view text);

// File names are arbitrary bytes, JSON is UTF-8. A byte b that is not UTF-8 becomes the private-use
// character U+EF00 + b (as in MirBSD's OPTU); text that already holds such a character is escaped
// byte by byte. NameFromJson(JsonName(x)) == x for every x.
std::string JsonName(std::string_view name);
std::string NameFromJson(std::string_view text);

// Suggestions for mistyped names.

// Whether `word` likely means `name`: a letter or two differ, or one is a prefix of the other.
bool IsNear(std::string_view word, std::string_view name);

// " (did you mean --out?)" with the names that `word` likely means, nearest first; empty if none.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& known);

// Untrusted text (names of files, models, classes) in output for people.

// For a terminal: escapes characters that would move its cursor, colour or hide text ("\x1b"),
// bytes that are not UTF-8, and marks that change the writing direction. Line breaks and tabs stay.
std::string EscapeControls(std::string_view text);

// For Markdown, within a line or a table cell: shown literally, never as HTML, links or emphasis.
// Line breaks become "\n".
std::string EscapeMarkdown(std::string_view text);

// A field of a CSV file (RFC 4180), quoted where necessary.
std::string EscapeCsv(std::string_view text);

// A word of a command for a shell (POSIX), quoted where necessary: messages suggest commands that
// hold the user's paths.
std::string ShellWord(std::string_view text);

// Text for HTML or XML, between tags or in a quoted attribute. Also escapes what EscapeControls
// escapes: a mark of writing direction would also reorder the text beside it.
std::string EscapeHtml(std::string_view text);

}  // namespace tilegrad
