// SPDX-License-Identifier: Apache-2.0
// Letters and characters of text.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace tilegrad {

// ASCII's capital letters made small, as names of formats and endings are compared.
std::string LowerCase(std::string_view text);

// "file", or "files" unless there is one; "class", "classes".
std::string Plural(std::string_view thing, bool one);
// "1 file", "2 files".
template <std::integral Number>
std::string Count(Number number, std::string_view thing) {
  return std::to_string(number) + " " + Plural(thing, number == 1);
}

// Names for files, each once: the second "chair" is "chair_2".
class UniqueNames {
 public:
  // `name`, or if it is taken the first of name_2, name_3, ... that is not; taken from now on.
  std::string Take(const std::string& name) {
    std::string unique = name;
    for (int i = 2; !taken_.insert(unique).second; ++i) unique = name + "_" + std::to_string(i);
    return unique;
  }

 private:
  std::set<std::string> taken_;
};

// "my%20wood.png" -> "my wood.png" (RFC 3986). A "+" is no space; a "%" that two hexadecimal digits
// do not follow stands for itself.
std::string DecodePercent(std::string_view uri);

// Appends a character of Unicode as UTF-8; U+FFFD for what is none (surrogates, above U+10FFFF).
void AppendUtf8(std::uint32_t character, std::string* out);

// The character at the beginning of a text that is not empty: how many bytes it has; 1, and `valid`
// false, where they are not UTF-8.
struct Utf8Character {
  std::uint32_t code = 0;
  std::size_t bytes = 1;
  bool valid = false;
};
Utf8Character FirstCharacter(std::string_view text);

bool IsUtf8(std::string_view text);

// Names of files are any bytes, JSON is UTF-8. A byte that is not, b, is written as the character
// U+EF00 + b, which nothing else is used for (as MirBSD's OPTU does); what is one of these already,
// byte by byte. NameFromJson(JsonName(x)) is x, whatever x is.
std::string JsonName(std::string_view name);
std::string NameFromJson(std::string_view text);

// What a person may have meant who has mistyped a name.

// Whether `word` is likely to mean `name`: a letter or two are otherwise, or one begins the other.
bool IsNear(std::string_view word, std::string_view name);

// " (did you mean --out?)" with the names, the nearest first, that `word` is likely to mean; empty
// if there is none.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& known);

// Text of strangers (names of files, models, classes) in what people look at.

// For a terminal: characters that would move its cursor, colour or hide text become visible,
// "\x1b", and so do bytes that are not UTF-8 and marks that turn the direction of writing. Line
// breaks and tabs stay.
std::string EscapeControls(std::string_view text);

// For Markdown, within a line or a table's cell: shown as it is, never as HTML, links or emphasis.
// Line breaks are written as "\n".
std::string EscapeMarkdown(std::string_view text);

// A field of a CSV file (RFC 4180): in quotes where it needs them.
std::string EscapeCsv(std::string_view text);

// Text for HTML or XML, between tags or in a quoted attribute. What EscapeControls
// makes visible is visible there, too: a mark of writing direction would turn what stands beside
// it.
std::string EscapeHtml(std::string_view text);

}  // namespace tilegrad
