// SPDX-License-Identifier: Apache-2.0
// Tables of scores: names of classes are text, whatever they hold.
#include <gtest/gtest.h>

#include <sstream>

#include "support/temp_folder.h"
#include "train/eval/evaluation.h"

namespace tilegrad::train::evaluation_table_test {

Evaluation Named(const std::string& name) {
  Evaluation e;
  e.predictor = name;
  e.split = "test";
  e.views_per_model = 1;
  e.classes = {name};
  e.class_models = {1};
  e.rows = {{name, {{0.5, 0.25}}, {0.5, 0.25}}};
  e.models = {{name, name, {0.5, 0.25}}};
  return e;
}

TEST(EvaluationTable, MarkdownHoldsNoHtmlAndNoFurtherCells) {
  const std::string text = FormatMarkdown(Named("<b onclick=x>|[y](z)\n*"));
  EXPECT_EQ(text.find('<'), std::string::npos) << text;
  EXPECT_NE(text.find("&lt;b onclick=x&gt;\\|\\[y\\](z)\\\\n\\*"), std::string::npos) << text;
  // The table's lines: heading, dashes, one method; three cells each.
  int lines = 0;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with('|')) continue;
    ++lines;
    int bars = 1;  // the first
    for (std::size_t i = 1; i < line.size(); ++i) bars += line[i] == '|' && line[i - 1] != '\\';
    EXPECT_EQ(bars, 4) << line;
  }
  EXPECT_EQ(lines, 3);
}

using WrittenEvaluation = TempFolderTest;

TEST_F(WrittenEvaluation, NamesNeedNotBeUtf8) {
  ASSERT_TRUE(WriteEvaluation(folder_, Named("caf\xe9")).ok());
  const auto back = ReadEvaluation(folder_);
  ASSERT_TRUE(back.ok()) << back.status().message();
  EXPECT_EQ((*back)->classes[0], "caf\xe9");
  EXPECT_NE(ReadText(folder_ / "eval.md").value().find("caf\\\\xe9"), std::string::npos);
}

}  // namespace tilegrad::train::evaluation_table_test
