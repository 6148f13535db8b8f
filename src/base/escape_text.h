// SPDX-License-Identifier: Apache-2.0
// Text of strangers (names of files, models, classes) in what people look at.
#pragma once

#include <string>
#include <string_view>

namespace tilegrad {

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
