// SPDX-License-Identifier: Apache-2.0
// The report of a tiny run: it needs nothing from outside, its data parses, text of files cannot
// break out of its place, and what is missing or broken is said by name.
#include "train/report/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/image_file.h"
#include "render/picture/composite.h"
#include "support/temp_folder.h"
#include "tiny_run.h"
#include "train/eval/evaluation.h"
#include "train/report/html.h"
#include "train/tasks/held_out.h"
#include "train/trainer.h"

namespace tilegrad::train::report_test {

constexpr const char* kEvil = "</script><b onclick=\"x\">&'";

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

// What stands between the first `begin` and the next `end`.
std::string Between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t from = text.find(begin);
  if (from == std::string::npos) return "";
  return text.substr(from + begin.size(), text.find(end, from) - from - begin.size());
}

class ReportTest : public TempFolderTest {
 protected:
  ReportTest() : workers_(1) {
    const Path data = folder_ / "data";
    EXPECT_TRUE(WriteNoiseDataset(data).ok());
    Dataset dataset = Dataset::Open(data).value();
    std::vector<ModelInfo> models = dataset.models();
    models.back().name = models.back().creator = models.back().license = kEvil;
    DatasetInfo info = dataset.info();
    info.credits = {kEvil};
    EXPECT_TRUE(WriteDatasetInfo(data, info).ok());
    EXPECT_TRUE(WriteModels(data, info, models).ok());
    TrainJob job;
    job.config = ParseConfig(kTinyConfig, "tiny").value();
    job.config.name = kEvil;
    job.config.schedule.steps = 3;
    job.data = data;
    job.run = job_.run = folder_ / "run";
    Ok(Train(job, workers_, watch_).status());
    job_.data = data;
    job_.out = folder_ / "page.html";
  }

  Result<ReportSummary> Make() { return WriteReport(job_, workers_, watch_); }
  std::string Page() {
    Ok(Make().status());
    return ReadText(job_.out).value();
  }
  void Evaluate(double own) { ASSERT_TRUE(WriteEvaluation(job_.run, Scores(own)).ok()); }
  Evaluation Scores(double own) const {
    const Dataset dataset = Dataset::Open(job_.data).value();
    Evaluation e;
    e.predictor = "elder network";
    e.split = "test";
    e.views_per_model = 4;
    e.classes = {"noise"};
    e.class_models = {2};
    const auto row = [](const char* method, double iou) {
      return EvaluationRow{method, {{iou, std::nullopt}}, {iou, std::nullopt}};
    };
    e.rows = {row("undeformed template", 0.25), row(kEvil, 0.5), row("tilegrad", own)};
    const int first = dataset.Select(Split::kTest)[0];
    e.models = {{"noise", dataset.models()[static_cast<std::size_t>(first)].id, {0.123, 0.456}}};
    return e;
  }

  Workers workers_;
  StopFlag stop_ = false;
  const Watch watch_ = {[](const Progress&) {}, &stop_};
  ReportJob job_;
};

TEST_F(ReportTest, NeedsNothingFromOutside) {
  std::string page = Page();
  const std::string xmlns = "http://www.w3.org/2000/svg";  // a name, not an address to load
  ASSERT_EQ(Count(page, xmlns), 1);
  page.erase(page.find(xmlns), xmlns.size());
  EXPECT_EQ(Count(page, "http:"), 0);
  EXPECT_EQ(Count(page, "https:"), 0);
  EXPECT_EQ(Count(page, "//cdn"), 0);
  EXPECT_EQ(Count(page, "{{"), 0);
  EXPECT_EQ(Count(page, "<img src=\"data:image/png;base64,"), 2 * 2 * kShownViews);
}

TEST_F(ReportTest, DataParsesAndHoldsCurvesAndMeshes) {
  const std::string text =
      Between(Page(), "<script type=\"application/json\" id=\"data\">", "</script>");
  const auto json = nlohmann::json::parse(text, nullptr, false);
  ASSERT_TRUE(json.is_object());
  EXPECT_EQ(json["curves"]["step"], (nlohmann::json{1, 2, 3}));
  EXPECT_EQ(json["curves"]["iou"].size(), 3u);
  // Every term of the log has a chart, under the task's words.
  EXPECT_EQ(json["charts"][0], (nlohmann::json{{"key", "loss"}, {"title", "Total loss"}}));
  EXPECT_EQ(json["charts"][2]["key"], "color");
  EXPECT_EQ(json["charts"][2]["title"], "Colour loss (mean L1)");
  EXPECT_EQ(json["charts"].size() + 1, json["curves"].size());
  ASSERT_EQ(json["models"].size(), 2u);
  EXPECT_EQ(json["models"][1]["name"], kEvil);
  EXPECT_EQ(json["models"][0]["prediction"]["index_bytes"], 2);
  EXPECT_TRUE(json["models"][0]["truth"].is_null());  // this dataset has no meshes
}

TEST_F(ReportTest, DrawsTheModelsInOnePicture) {
  job_.sheet = folder_ / "sheet.png";
  const auto summary = Ok(Make());
  EXPECT_EQ(summary->sheet_columns,
            "input, prediction, prediction from another side, truth from there");
  const ImageU8 sheet = io::LoadImage(job_.sheet).value();
  // Two models; pictures of 32 pixels are drawn six times as large, 4 apart.
  EXPECT_EQ(sheet.width, 4 * 192 + 3 * 4);
  EXPECT_EQ(sheet.height, 2 * 192 + 4);
  const Dataset dataset = Dataset::Open(job_.data).value();
  const auto images = dataset.LoadImages(dataset.Select(Split::kTest)[1]).value();
  const std::size_t bytes = images.size() / 4;
  const auto shown = [&](int view, int left) {
    const auto image = std::span(images).subspan(bytes * static_cast<std::size_t>(view), bytes);
    const ImageU8 expected = OnPaper(image, 32);
    for (int y = 0; y < 192; ++y) {
      for (int x = 0; x < 192; ++x)
        ASSERT_EQ(sheet.at(left + x, 196 + y)[1], expected.at(x / 6, y / 6)[1]);
    }
  };
  const std::vector<int> views = ShownViews(4);
  shown(views[0], 0);
  shown(views[1], 3 * 196);
}

TEST_F(ReportTest, SaysThatThereIsNoEvaluationYet) {
  const std::string page = Page();
  EXPECT_EQ(Count(page, "It has not been evaluated"),
            2);  // in the summary and in place of the table
  EXPECT_EQ(Count(page, "<table class=\"scores\">"), 0);
  EXPECT_FALSE(Make()->evaluated);
}

TEST_F(ReportTest, CallsHeldOutWhatTheRunCanTell) {
  EXPECT_EQ(Count(Page(), "None of these was seen in training."), 1);
  std::filesystem::remove(job_.run / "training_models.txt");
  const std::string page = Page();
  EXPECT_EQ(Count(page, "seen in training"), 0);
  EXPECT_EQ(Count(page, "has no list of what it was trained on"), 1);
}

TEST_F(ReportTest, SaysWhenOtherModelsWereScored) {
  Evaluation e = Scores(0.5);
  for (const auto& [source, count] : {std::pair("nmr", 0), std::pair("cars", 1)}) {
    e.dataset_source = source;
    ASSERT_TRUE(WriteEvaluation(job_.run, e).ok());
    EXPECT_EQ(Count(Page(), "of another source than those trained on: "), count) << source;
  }
}

TEST_F(ReportTest, MarksTheBestAndComparesWithBaselines) {
  Evaluate(0.6);
  std::string page = Page();
  EXPECT_EQ(Count(page, "<strong>60.0</strong>"), 2);  // of the class and of the mean
  EXPECT_EQ(Count(page, "<strong>50.0</strong>"), 0);
  EXPECT_EQ(Count(page,
                  "Mean 3D IoU on 2 models of the test split: <b>60.0 %</b>; undeformed template: "
                  "25.0 %; "),
            1);
  EXPECT_EQ(Count(page, "<span>3D IoU 12.3 %</span> <span>F-score 45.6 %</span>"), 1);
  EXPECT_EQ(Count(page, "The scores are of: elder network"), 1);
  Evaluate(0.1);
  page = Page();
  EXPECT_EQ(Count(page, "<strong>50.0</strong>"), 2);
}

// One shape under several lights: its 3D IoU tells nothing apart.
TEST_F(ReportTest, ComparesPicturesUnderTheirLights) {
  Evaluation e = Scores(0.5);
  double error = 0.04;
  for (EvaluationRow& row : e.rows) row.mean.lit_l1 = error /= 2;
  e.rows.back().mean.light_angle = 12.34;
  ASSERT_TRUE(WriteEvaluation(job_.run, e).ok());
  const std::string page = Page();
  EXPECT_EQ(Count(page,
                  "the mean colour error of its renders is <b>0.0050</b> of 1; undeformed "
                  "template: 0.0200"),
            1);
  EXPECT_EQ(Count(page, "the predicted lights are off by 12.3 degrees."), 1);
  EXPECT_EQ(Count(page, "width:80.0%\"></span><span class=\"value\">0.0200</span>"), 1);
  EXPECT_EQ(Count(page, "width:20.0%\"></span><span class=\"value\">0.0050</span>"), 1);
  EXPECT_EQ(Count(page, "baselines"), 0);
}

TEST_F(ReportTest, SameRunSameBytes) {
  const std::string first = Page();
  const Workers three(3);
  Ok(WriteReport(job_, three, watch_).status());
  EXPECT_EQ(ReadText(job_.out).value(), first);
}

TEST_F(ReportTest, ErrorsNameTheFileAndKeepThePage) {
  Write("page.html", std::string("old"));
  const auto broken = [&](const std::string& name, const std::string& text) {
    const Path file = folder_ / name;
    const Bytes before = std::filesystem::exists(file) ? ReadFile(file).value() : Bytes();
    Write(name, text);
    const Status status = Make().status();
    if (before.empty())
      std::filesystem::remove(file);
    else
      Write(name, before);
    return status;
  };
  ExpectMessage(broken("run/run.json", "{}"), "run.json", "dataset");
  ExpectMessage(broken("run/run.json", "{"), "run.json", "line 1");
  ExpectMessage(broken("run/config.toml", "nmae = 1\n"), "config.toml", "nmae");
  ExpectMessage(broken("run/metrics.jsonl", "x\n"), "metrics.jsonl", "line 1");
  ExpectMessage(broken("run/eval.json", "[]"), "eval.json");
  ExpectMessage(broken("data/models.jsonl", "x\n"), "models.jsonl", "line 1");
  EXPECT_EQ(ReadText(job_.out).value(), "old");
  std::filesystem::remove_all(job_.run / "checkpoints");
  ExpectMessage(Make().status(), "run", "checkpoint");
}

TEST_F(ReportTest, BrokenEvaluationsAreRefused) {
  Evaluate(0.6);
  const auto good = nlohmann::json::parse(ReadText(job_.run / "eval.json").value());
  const auto with = [&](const char* key, nlohmann::json value) {
    auto json = good;
    json[key] = std::move(value);
    Write("run/eval.json", json.dump());
    return Make().status();
  };
  ExpectMessage(with("rows", nlohmann::json::array()), "eval.json", "rows");
  ExpectMessage(with("rows", {1}), "eval.json", "rows");
  ExpectMessage(with("classes", {"a", "b"}), "eval.json", "class");
  ExpectMessage(with("class_models", {"many"}), "eval.json", "class_models");
  ExpectMessage(with("models", {{{"iou", 1}}}), "eval.json", "models");
  for (const nlohmann::json& count : nlohmann::json::array({4294967298, -1, 1.5}))
    ExpectMessage(with("class_models", {count}), "eval.json", "class_models");
}

// Numbers that double does not have, values nested deeply, keys that come twice.
TEST_F(ReportTest, WildFilesOfARun) {
  Evaluate(0.6);
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  const auto with_first = [&](const std::string& name, const std::string& field) {
    const std::string before = ReadText(job_.run / name).value();
    Write("run/" + name, "{" + field + "," + before.substr(before.find('{') + 1));
    const Status status = Make().status();
    Write("run/" + name, before);
    return status;
  };
  for (const char* name : {"run.json", "eval.json"}) {
    ExpectMessage(with_first(name, "\"x\": 1e999"), name, "1e999");
    ExpectMessage(with_first(name, "\"x\": " + deep), name, "nested");
    EXPECT_TRUE(with_first(name, R"("x": {"\\": "[[[\"{", "y": -0.0}, "x": 1e-999)").ok());
  }
  const std::string one = R"("classes": [{"iou": 1}], "mean": )";
  ExpectMessage(with_first("eval.json", R"("rows": [{"method": "a", )" + one + deep + "}]"),
                "eval.json", "nested");
  ExpectMessage(with_first("run.json", "\"machine\": {\"cpu\": " + deep + "}"), "run.json",
                "nested");
  EXPECT_TRUE(
      with_first("run.json", R"("machine": 7, "parameters": "x")").ok());  // the last counts
  EXPECT_TRUE(with_first("metrics.jsonl", R"("loss": 1e-320)").ok());
}

TEST_F(ReportTest, CurvesOfNumbersNextToZero) {
  Write("run/metrics.jsonl",
        std::string("{\"step\":1,\"loss\":1e-320,\"iou\":-1.7976931348623157e308}\n"));
  ExpectIn(Page(), "e-32");
}

TEST_F(ReportTest, StopWritesNothing) {
  stop_ = true;
  EXPECT_EQ(Make().status().code(), StatusCode::kCancelled);
  EXPECT_FALSE(std::filesystem::exists(job_.out));
}

TEST(ReportHtml, Base64) {  // RFC 4648, section 10
  const auto encode = [](const std::string& text) {
    return Base64(Bytes(text.begin(), text.end()));
  };
  EXPECT_EQ(encode(""), "");
  EXPECT_EQ(encode("f"), "Zg==");
  EXPECT_EQ(encode("fo"), "Zm8=");
  EXPECT_EQ(encode("foo"), "Zm9v");
  EXPECT_EQ(encode("foobar"), "Zm9vYmFy");
}

TEST(ReportHtml, TemplateFillsOnce) {
  EXPECT_EQ(FillTemplate("a{{x}}b{{y}}", {{"x", "{{y}}"}, {"y", "2"}}).value(), "a{{y}}b2");
  ExpectMessage(FillTemplate("{{z}}", {}).status(), "\"z\"");
}

TEST(ReportData, MeshKeepsSixteenBits) {
  Mesh mesh;
  mesh.positions = {{-1, 0, 2}, {1, 0, 4}, {0, 0, 3}};
  mesh.faces = {{0, 1, 2}};
  const auto json = MeshJson(mesh);
  EXPECT_EQ(json["low"], (nlohmann::ordered_json{-1.0, 0.0, 2.0}));
  EXPECT_EQ(json["high"], (nlohmann::ordered_json{1.0, 0.0, 4.0}));
  // Steps 0 0 0, 65535 0 65535, 32768 0 32768 (half rounds up), little-endian; y has no extent.
  const Bytes steps = {0, 0, 0, 0, 0, 0, 255, 255, 0, 0, 255, 255, 0, 128, 0, 0, 0, 128};
  EXPECT_EQ(json["positions"], Base64(steps));
  EXPECT_EQ(json["colors"], Base64(Bytes(9, 255)));
  EXPECT_EQ(json["faces"], Base64(Bytes{0, 0, 1, 0, 2, 0}));
  EXPECT_TRUE(json["texture"].is_null());
  EXPECT_TRUE(MeshJson(Mesh()).is_null());
}

TEST(ReportData, MeshHasTheTextureThatAllFacesShare) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  mesh.faces = {{0, 1, 2}, {2, 1, 3}};
  mesh.corner_uvs = {{0, 0}, {2, 0}, {0, 1}, {0, 1}, {2, 0}, {2, 1}};
  mesh.textures = {{"t", ImageU8(2, 2, 3, 7)}};
  mesh.materials = {{.name = "m",
                     .base_color = {1, 0.2f, 0, 1},
                     .base_color_texture = 0,
                     .wrap = {TextureWrap::kMirror, TextureWrap::kClamp}}};
  const auto json = MeshJson(mesh);
  EXPECT_EQ(json["texture"]["image"], PngAddress(ImageU8(2, 2, 3, 7)).value());
  EXPECT_EQ(json["texture"]["wrap"], (nlohmann::ordered_json{"MIRRORED_REPEAT", "CLAMP_TO_EDGE"}));
  EXPECT_EQ(json["texture"]["low"], (nlohmann::ordered_json{0.0, 0.0}));
  EXPECT_EQ(json["texture"]["high"], (nlohmann::ordered_json{2.0, 1.0}));
  const Bytes steps = {0, 0, 0,   0,   255, 255, 0, 0, 0,   0,   255, 255,
                       0, 0, 255, 255, 255, 255, 0, 0, 255, 255, 255, 255};
  EXPECT_EQ(json["texture"]["uvs"], Base64(steps));
  const Bytes factor = {255, 51, 0, 255, 51, 0, 255, 51, 0, 255, 51, 0};
  EXPECT_EQ(json["colors"], Base64(factor));
  // Two textures are two pictures; the page draws one.
  mesh.materials.push_back({.name = "plain", .base_color_texture = -1});
  mesh.face_materials = {0, 1};
  EXPECT_TRUE(MeshJson(mesh)["texture"].is_null());
}

TEST(ReportData, ThinKeepsMeansAndTheLastStep) {
  std::vector<LogEntry> log;
  for (int i = 1; i <= 10; ++i) log.push_back({i, {{"loss", 1.0 * i}}});
  const auto thin = Thin(log, 5);
  ASSERT_EQ(thin.size(), 5u);
  EXPECT_EQ(thin[0].values[0].second, 1.5);
  EXPECT_EQ(thin[4].step, 10);
  EXPECT_EQ(Thin(log, 10).size(), 10u);
}

}  // namespace tilegrad::train::report_test
