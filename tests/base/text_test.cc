// SPDX-License-Identifier: Apache-2.0
// Words for people, numbers and names from outside.
#include "base/text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/json_text.h"
#include "base/rng.h"
#include "base/whole_number.h"

namespace tilegrad::text_test {

TEST(Words, OneIsOne) {
  EXPECT_EQ(Count(1, "image"), "1 image");
  EXPECT_EQ(Count(0, "image"), "0 images");
  EXPECT_EQ(Count(std::uint64_t{2}, "class"), "2 classes");
  EXPECT_EQ(Count(std::int64_t{1}, "class"), "1 class");
}

TEST(Words, AreSuggestedWhereTheyAreNear) {
  EXPECT_TRUE(IsNear("stepz", "steps"));
  EXPECT_TRUE(IsNear("schedule.step", "schedule.steps"));
  EXPECT_FALSE(IsNear("optimizer.lr", "softras.far"));
  EXPECT_FALSE(IsNear("lr", "far"));
  EXPECT_EQ(DidYouMean("--outp", {"--outputs", "--out", "--view"}),
            " (did you mean --out or --outputs?)");
  EXPECT_EQ(DidYouMean("--color", {"--view"}), "");
}

TEST(Text, PercentIsDecodedAndPlusIsNoSpace) {
  EXPECT_EQ(DecodePercent("my%20wood+red%2Bblue.png"), "my wood+red+blue.png");
  EXPECT_EQ(DecodePercent("50%25.png"), "50%.png");
  EXPECT_EQ(DecodePercent("%c3%A9"), "\xc3\xa9");
  EXPECT_EQ(DecodePercent("%2525"), "%25");  // once
  EXPECT_EQ(DecodePercent(std::string_view("a%00b")), std::string("a\0b", 3));
}

TEST(Text, PercentWithoutTwoDigitsStaysAsItIs) {
  for (const char* text : {"", "%", "100%", "%4", "%zz", "%-1", "%+1", "% 1", "%0x41"})
    EXPECT_EQ(DecodePercent(text), text);
}

TEST(WholeNumber, IsDefinedForEveryNumber) {
  constexpr int kMost = std::numeric_limits<int>::max(), kLeast = std::numeric_limits<int>::min();
  EXPECT_EQ(WholeNumber<int>(2.9f), 2);
  EXPECT_EQ(WholeNumber<int>(-2.9), -2);
  EXPECT_EQ(WholeNumber<int>(NAN), 0);
  EXPECT_EQ(WholeNumber<int>(HUGE_VALF), kMost);
  EXPECT_EQ(WholeNumber<int>(-HUGE_VAL), kLeast);
  EXPECT_EQ(WholeNumber<int>(2147483647.5), kMost);
  EXPECT_EQ(WholeNumber<int>(2147483646.5), kMost - 1);
  EXPECT_EQ(WholeNumber<int>(2147483648.0f), kMost);
  EXPECT_EQ(WholeNumber<int>(2147483520.0f), 2147483520);  // the float before
  EXPECT_EQ(WholeNumber<int>(-2147483648.0f), kLeast);
  EXPECT_EQ(WholeNumber<std::size_t>(-1.0f), 0u);
  EXPECT_EQ(WholeNumber<std::size_t>(1e30), std::numeric_limits<std::size_t>::max());
  EXPECT_EQ(WholeNumber<std::uint8_t>(255.9f), 255);
  EXPECT_EQ(WholeNumber<std::int64_t>(9223372036854775807.0),
            std::numeric_limits<std::int64_t>::max());
  static_assert(WholeNumber<int>(3.5) == 3);
}

TEST(Text, TellsUtf8) {
  for (const std::string good : {"", "a", "\xc3\xa9", "\xe2\x82\xac", "\xf0\x9f\x98\x80"})
    EXPECT_TRUE(IsUtf8(good)) << good;
  for (const std::string bad :
       {"\xe9", "a\xff", "\xc3", "\xc0\x80", "\xed\xa0\x80", "\xf5\x80\x80\x80"})
    EXPECT_FALSE(IsUtf8(bad)) << bad;
}

// Of any bytes, the characters that stand for bytes among them.
TEST(JsonNames, ComeBackAsTheyWere) {
  EXPECT_EQ(JsonName("caf\xc3\xa9.png"), "caf\xc3\xa9.png");
  EXPECT_EQ(JsonName("caf\xe9.png"), "caf\xee\xbf\xa9.png");
  std::vector<std::string> names = {"", "\xee\xbf\xa9", "\xee\xbe\x80\xff", "a\0b"};
  Rng rng(7);
  for (int i = 0; i < 500; ++i) {
    std::string name;
    for (std::uint64_t n = rng.Below(12); n-- > 0;) {
      const bool mark = rng.Below(4) == 0;
      name += mark ? std::string("\xee\xbf\xa9") : std::string(1, static_cast<char>(rng.Next()));
    }
    names.push_back(name);
  }
  for (const std::string& name : names) {
    const std::string text = JsonName(name);
    EXPECT_TRUE(IsUtf8(text));
    EXPECT_EQ(NameFromJson(text), name);
  }
}

TEST(JsonNames, GoThroughFiles) {
  const nlohmann::json json = {{"folder", "d\xe9j\xe0"}, {"list", {"\xff", "plain"}}, {"n", 3}};
  const std::string text = JsonText(json);
  EXPECT_TRUE(IsUtf8(text));
  EXPECT_EQ(ParseJson(text, "a.json").value(), json);
}

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

TEST(ShellWord, QuotesWhereItMust) {
  EXPECT_EQ(ShellWord("runs/mine-2.0"), "runs/mine-2.0");
  EXPECT_EQ(ShellWord("my runs/a"), "'my runs/a'");
  EXPECT_EQ(ShellWord("Bob's $HOME"), "'Bob'\\''s $HOME'");
  EXPECT_EQ(ShellWord(""), "''");
}

}  // namespace tilegrad::text_test
