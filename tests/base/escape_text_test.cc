// SPDX-License-Identifier: Apache-2.0
#include "base/escape_text.h"

#include <gtest/gtest.h>

namespace tilegrad::escape_text_test {

TEST(EscapeControls, KeepsTextOfEveryLanguage) {
  for (const char* text : {"", "chair.obj", "St\u00fchle \u6905\u5b50 \U0001fa91", "a\tb\nc\n"}) {
    EXPECT_EQ(EscapeControls(text), text);
  }
}

TEST(EscapeControls, ShowsWhatATerminalWouldObey) {
  EXPECT_EQ(EscapeControls("\x1b[2Jred\x1b[31m"), "\\x1b[2Jred\\x1b[31m");
  EXPECT_EQ(EscapeControls("a\rb\bc\x07"), "a\\x0db\\x08c\\x07");
  EXPECT_EQ(EscapeControls(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(EscapeControls("\x7f\xc2\x9b"
                           "31m"),
            "\\x7f\\x9b31m");  // a control of two bytes
  EXPECT_EQ(EscapeControls("a\u202egpj.exe"), "a\\u202egpj.exe");
  EXPECT_EQ(EscapeControls("a\u061cb\u2028c\u2066d"), "a\\u061cb\\u2028c\\u2066d");
}

TEST(EscapeControls, ShowsBytesThatAreNotUtf8) {
  EXPECT_EQ(EscapeControls("\x9b"
                           "31m"),
            "\\x9b31m");  // a control of one byte
  EXPECT_EQ(EscapeControls("caf\xe9"), "caf\\xe9");
  EXPECT_EQ(EscapeControls("\xc0\x9b"), "\\xc0\\x9b");           // ESC's own, written too long
  EXPECT_EQ(EscapeControls("\xe2\x80"), "\\xe2\\x80");           // cut short
  EXPECT_EQ(EscapeControls("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // half of a pair
  EXPECT_EQ(EscapeControls("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // beyond the last
}

TEST(EscapeMarkdown, IsTextAndNothingElse) {
  EXPECT_EQ(EscapeMarkdown("office-chair 2.0"), "office-chair 2.0");
  EXPECT_EQ(EscapeMarkdown("<img src=x onerror=a()>"), "&lt;img src=x onerror=a()&gt;");
  EXPECT_EQ(EscapeMarkdown("a|b"), "a\\|b");
  EXPECT_EQ(EscapeMarkdown("[x](http://y) *z* _w_ `v`"),
            "\\[x\\](http://y) \\*z\\* \\_w\\_ \\`v\\`");
  EXPECT_EQ(EscapeMarkdown("a\n\n# b"), "a\\\\n\\\\n\\# b");
  EXPECT_EQ(EscapeMarkdown("&lt;\x1b"), "&amp;lt;\\\\x1b");
}

TEST(EscapeHtml, IsTextAndNothingElse) {
  EXPECT_EQ(EscapeHtml("St\u00fchle, 3 < 4"), "St\u00fchle, 3 &lt; 4");
  EXPECT_EQ(EscapeHtml("\"><script>'&"), "&quot;&gt;&lt;script&gt;&#39;&amp;");
  EXPECT_EQ(EscapeHtml("\u202eevil\x1b\xff"), "\\u202eevil\\x1b\\xff");
  EXPECT_EQ(EscapeHtml("a\nb"), "a\nb");
}

TEST(EscapeCsv, QuotesWhereItMust) {
  EXPECT_EQ(EscapeCsv("sphere"), "sphere");
  EXPECT_EQ(EscapeCsv("a,b"), "\"a,b\"");
  EXPECT_EQ(EscapeCsv("a\"b\nc"), "\"a\"\"b\nc\"");
}

}  // namespace tilegrad::escape_text_test
