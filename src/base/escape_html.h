// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace tilegrad {

// Text for HTML or XML, between tags or in a quoted attribute.
std::string EscapeHtml(std::string_view text);

}  // namespace tilegrad
