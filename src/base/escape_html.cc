// SPDX-License-Identifier: Apache-2.0
#include "base/escape_html.h"

#include "base/escape_text.h"

namespace tilegrad {

std::string_view HtmlEntity(char c) {
  switch (c) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    case '\'':
      return "&#39;";
    default:
      return "";
  }
}

std::string EscapeHtml(std::string_view text) {
  std::string out;
  for (const char c : EscapeControls(text)) {
    const std::string_view entity = HtmlEntity(c);
    entity.empty() ? out += c : out += entity;
  }
  return out;
}

}  // namespace tilegrad
