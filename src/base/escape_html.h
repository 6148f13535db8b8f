// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace tilegrad {

// Text for HTML or XML, between tags or in a quoted attribute. What EscapeControls (escape_text.h)
// makes visible is visible there, too: a mark of writing direction would turn what stands beside
// it.
std::string EscapeHtml(std::string_view text);

// "&lt;" for '<'; empty for characters that need none.
std::string_view HtmlEntity(char c);

}  // namespace tilegrad
