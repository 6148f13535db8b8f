// SPDX-License-Identifier: Apache-2.0
// The files of the page, compiled in: report.html with {{placeholders}}, report.css, report.js.
#pragma once

#include <string_view>

namespace tilegrad::train {

extern const std::string_view kReportHtml, kReportCss, kReportJs;
// What both pages draw with, and the live page.
extern const std::string_view kPartsJs, kLiveHtml, kLiveJs;

}  // namespace tilegrad::train
