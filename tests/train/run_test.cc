// SPDX-License-Identifier: Apache-2.0
// Configuration, checkpoints, logs, TensorBoard records, data order.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <array>
#include <map>
#include <set>

#include "nn/nn.h"
#include "scene/camera.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"
#include "tiny_run.h"
#include "train/config.h"
#include "train/data/batches.h"
#include "train/run/checkpoint.h"
#include "train/run/log.h"
#include "train/run/run_files.h"

namespace tilegrad::train::run_test {

class RunTest : public TempFolderTest {
 protected:
  RunTest() : workers_(1), context_(workers_) {}
  Workers workers_;
  nn::Context context_;
};

// The same numbers as in the log and on pages.
TEST(StepValuesText, HasTermsWithoutTheirWeights) {
  StepValues values;
  values.loss = 2.569;
  values.terms = {{"iou", 10, 0.2458}, {"color", 1, 0.111}, {"watched", 0, 5}};
  EXPECT_EQ(values.ForConsole(), "loss 2.5690  iou 0.246  color 0.111");
}

TEST_F(RunTest, ConfigRoundTrip) {
  TrainConfig config = ParseConfig("", "defaults").value();
  config.name = "odd \"name\"";
  ValueOf<double>(config, "optimizer.learning_rate") = 3.3e-5;
  ValueOf<std::int64_t>(config, "network.channels") = 7;
  auto back = Ok(ParseConfig(WriteConfig(config), "c"));
  EXPECT_EQ(WriteConfig(*back), WriteConfig(config));
  EXPECT_EQ(back->name, config.name);
  EXPECT_EQ(ValueOf<double>(*back, "optimizer.learning_rate"), 3.3e-5);
}

TEST_F(RunTest, ConfigsOfTheProjectAreValid) {
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(Path(TILEGRAD_SOURCE_DIR) / "configs")) {
    const auto config = Ok(ReadConfig(entry.path()));
    EXPECT_EQ(config->name, entry.path().stem().string());
    Ok(ParseConfig(WriteConfig(*config), "its own text").status());
    ++files;
  }
  EXPECT_GE(files, 16);
}

TEST_F(RunTest, ConfigErrorsNameFileLineAndKey) {
  const auto error = [&](const std::string& name, const std::string& text) {
    return ReadConfig(Write(name, text)).status();
  };
  ExpectMessage(error("a.toml", "name = \"x\"\n[network]\nchanels = 3\n"), "a.toml", "line 3",
                "network.chanels", "network.channels");
  ExpectMessage(error("b.toml", "[schedule]\nbatch = 1\n"), "line 2", "schedule.batch is 1", "[2,");
  ExpectMessage(error("c.toml", "[schedule]\nbatch = \"many\"\n"), "line 2", "whole number");
  ExpectMessage(error("d.toml", "[schedule\n"), "d.toml", "line");
  ExpectMessage(error("e.toml", "[optimizer]\nlearning_rate = nan\n"), "learning_rate");
  ExpectMessage(ReadConfig(folder_ / "none.toml").status(), "none.toml");
}

TEST_F(RunTest, KeysOfFormerVersionsArePassedOver) {
  const std::string texture = "task.kind = \"textured_image\"\n";
  const auto old = Ok(ParseConfig(texture + "network.wrap = true\n", "old"));
  EXPECT_EQ(WriteConfig(*old), WriteConfig(ParseConfig(texture, "new").value()));
  ExpectMessage(ParseConfig(texture + "network.wrap = false\n", "c.toml").status(), "c.toml",
                "line 2", "network.wrap was removed", "true");
  const auto set = [](const char* assignment) {
    TrainConfig config = ParseConfig("task.kind = \"textured_image\"\n", "new").value();
    return ApplyOverrides({assignment}, &config);
  };
  EXPECT_TRUE(set("network.wrap=true").ok());
  ExpectMessage(set("network.wrap=false"), "network.wrap was removed");
  ExpectMessage(set("network.wrap=maybe"), "unknown key \"network.wrap\"");
  // Without a result: any value. Numbers are compared.
  EXPECT_TRUE(ParseConfig("schedule.shard_optimizer = false\n", "old").ok());
  EXPECT_TRUE(ParseConfig("network.stiffness = 0.0\n", "old").ok());
  ExpectMessage(ParseConfig("network.stiffness = 5.0\n", "old").status(), "network.stiffness",
                "behaves as with 0");
}

// toml++ frees tables in tables by recursion.
TEST_F(RunTest, ConfigsOfDeepKeys) {
  std::string key;
  for (int i = 0; i < 100'000; ++i) key += "a.";
  ExpectMessage(ParseConfig(key + "b = 1", "deep").status(), "deep", "dots");
  ExpectMessage(ParseConfig("[" + key + "b]", "deep").status(), "deep", "dots");
  ExpectMessage(ParseConfig(key.substr(0, 4000) + "b = 1", "less").status(), "less", "unknown key");
}

TEST_F(RunTest, WholeNumbersWhereFractionsAreAllowed) {
  auto config = Ok(ParseConfig("[loss]\ncolor = 2\n", "a"));
  EXPECT_EQ(ValueOf<double>(*config, "loss.color"), 2);
  // 2^53 + 1 is no double: what stood here by chance was taken, in the range or not.
  ExpectMessage(ParseConfig("[loss]\ncolor = 9007199254740993\n", "b").status(),
                "loss.color is 9007199254740992");
}

TEST_F(RunTest, Overrides) {
  TrainConfig config = ParseConfig("", "defaults").value();
  EXPECT_TRUE(ApplyOverrides({"schedule.steps=5", "name=me", "loss.color=0.5"}, &config).ok());
  EXPECT_EQ(config.schedule.steps, 5);
  EXPECT_EQ(config.name, "me");
  // Whatever a name holds, the file can be read back.
  for (const char* name : {"a\"b\n\tc\\ \u00e9", "\xff\xfe", "\x27\x27\x27", "\x01", ""}) {
    if (!ApplyOverrides({std::string("name=") + name}, &config).ok()) continue;
    const auto again = Ok(ParseConfig(WriteConfig(config), "written"));
    EXPECT_EQ(again->name, config.name);
  }
  ExpectMessage(ApplyOverrides({"training.batches=5"}, &config), "did you mean schedule.batch?");
  ExpectMessage(ApplyOverrides({"loss.color=red"}, &config), "loss.color");
  ExpectMessage(ApplyOverrides({"loss.color"}, &config), "key=value");
  ExpectMessage(ApplyOverrides({"name=caf\xe9"}, &config), "name", "UTF-8");
  ExpectMessage(ApplyOverrides({"task.kind=other"}, &config), "task.kind");
  EXPECT_EQ(ValueOf<double>(config, "stream.share"), 0);  // refused though nothing is streamed
  ExpectMessage(ApplyOverrides({"stream.cache=lots"}, &config), "stream.cache", "\"lots\"");
  ExpectMessage(ParseConfig("stream.cache = \"0\"\n", "c.toml").status(), "c.toml", "stream.cache");
  EXPECT_EQ(config.kind, "single_image");
}

TEST_F(RunTest, TheTaskDecidesWhichKeysThereAre) {
  const auto config = Ok(ParseConfig("[task]\nkind = \"single_image\"\n", "named"));
  EXPECT_EQ(WriteConfig(*config), WriteConfig(ParseConfig("", "default").value()));
  ExpectMessage(ParseConfig("[task]\nkind = \"sculpture\"\n", "c.toml").status(), "c.toml",
                "\"sculpture\"", "\"single_image\"");
  ExpectMessage(ParseConfig("[task]\nkind = 3\n", "c.toml").status(), "task.kind", "string");
}

TEST_F(RunTest, FieldsOfEveryType) {
  std::string word = "a";
  std::int64_t large = 1;
  int small = 2;
  double number = 3;
  bool flag = false;
  const ConfigFields fields = {{"t.word", &word, 0, 0, "text"},
                               {"large", &large, 0, kNoLimit, "whole", Affects::kReporting},
                               {"t.small", &small, 0, 9, "whole"},
                               {"u.number", &number, 0, 9, "any"},
                               {"t.flag", &flag, 0, 0, "on or off"}};
  ASSERT_TRUE(ReadFields("large = 7\nt.word = \"b\"\n[u]\nnumber = 0.5\n", fields).ok());
  ASSERT_TRUE(OverrideFields({"t.flag=true", "t.small=4"}, fields).ok());
  EXPECT_EQ(ResultSettings(fields), "t.word = b\nt.small = 4\nu.number = 0.5\nt.flag = true\n");
  const std::string text = WriteFields(fields);
  word = "";
  large = 0;
  small = 0;
  number = 0;
  flag = false;
  ASSERT_TRUE(ReadFields(text, fields).ok());
  EXPECT_EQ(WriteFields(fields), text);
  EXPECT_EQ(large, 7);
  ExpectMessage(ReadFields("t.flag = 1", fields), "t.flag", "true or false");
  ExpectMessage(ReadFields("t.small = 4294967300", fields), "t.small", "[0, 9]");
  EXPECT_EQ(small, 4);
  number = 10;
  ExpectMessage(CheckFields(fields), "u.number is 10");
}

// In words of what is expected, not of a parser.
TEST_F(RunTest, WhatIsWrongWithAnAssignmentIsSaid) {
  TrainConfig config = ParseConfig("", "default").value();
  const auto error = [&](const std::string& assignment) {
    return ApplyOverrides({assignment}, &config);
  };
  for (const std::string value : {"ten", "1.5", "", "[1]", "3\nseed = 4", "\"3\""}) {
    ExpectMessage(error("schedule.steps=" + value), "schedule.steps=" + value,
                  "schedule.steps must be a whole number");
  }
  ExpectMessage(error("schedule.steps=-1"), "schedule.steps is -1");
  ExpectMessage(error("loss.color=yes"), "loss.color must be a number");
  ExpectMessage(error("schedule.stepz=3"), "did you mean schedule.steps?");
  ExpectMessage(error("steps=3"), "did you mean schedule.steps?");
  ExpectMessage(error("network.steps=3"), "did you mean schedule.steps?");
  const Status far_off = error("optimizer.lr=3");
  ExpectMessage(far_off, "unknown key \"optimizer.lr\"; [optimizer] has ");
  ExpectMessage(ParseConfig("zyxwvu = 1", "less").status(),
                "\"zyxwvu\"; the config.toml of any run");
  ExpectNotIn(far_off.message(), "did you mean");
  ExpectMessage(ParseConfig("[schedule]\nsteps = ten\n", "c.toml").status(), "c.toml", "line 2",
                "text needs quotes");
}

std::vector<nn::NamedTensor> SomeTensors(nn::Context& context, double value) {
  return {{"w", context.Full({3, 2}, value)}};
}

TEST_F(RunTest, OnlyBrokenCheckpointsAreAnError) {
  Write("checkpoints/step_00000010.safetensors", "garbage");
  ExpectMessage(LoadNewestCheckpoint(context_, folder_).status(), "step_00000010");
  Ok(nn::WriteSafetensors(folder_ / "other.safetensors", {SomeTensors(context_, 1), {}}));
  ExpectMessage(LoadCheckpoint(context_, folder_ / "other.safetensors").status(),
                "not a checkpoint");
}

TEST_F(RunTest, PruneKeepsTheNewest) {
  for (const std::int64_t step : {1, 2, 3, 4}) {
    ASSERT_TRUE(SaveCheckpoint(folder_, {step, 64, "", 0}, SomeTensors(context_, 0)).ok());
  }
  PruneCheckpoints(folder_, 2);
  const auto files = ListCheckpoints(folder_);
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].filename(), "step_00000003.safetensors");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "checkpoints"), {}), 2);
}

TEST_F(RunTest, HalfWrittenFilesOfAKilledRunGo) {
  for (const char* name : {"checkpoints/step_00000009.safetensors", "config.toml",
                           "samples/step_00000009.png", "tensorboard/events", "timelapse/9.png"}) {
    Write(std::string(name) + ".4194305.tmp", "left by a killed run");
    Write(name, "whole");
  }
  RemoveHalfWritten(folder_);
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_)) {
    EXPECT_NE(entry.path().extension(), ".tmp");
    files += entry.is_regular_file() ? 1 : 0;
  }
  EXPECT_EQ(files, 5);
}

TEST_F(RunTest, OneWrongBitIsFoundAnywhere) {
  ASSERT_TRUE(SaveCheckpoint(folder_, {7, 64, "name = \"x\"", 1.5}, SomeTensors(context_, 3)).ok());
  const Path file = ListCheckpoints(folder_)[0];
  Bytes bytes = ReadFile(file).value();
  int harmless = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] ^= 4;
    Write("checkpoints/step_00000007.safetensors", bytes);
    const auto loaded = LoadCheckpoint(context_, file);
    bytes[i] ^= 4;
    if (!loaded.ok()) continue;
    // The key "checksum" itself and the spaces behind the header bear nothing.
    ++harmless;
    EXPECT_EQ(loaded->info.step, 7);
    EXPECT_EQ(loaded->info.seconds, 1.5);
    EXPECT_EQ(std::as_const(loaded->tensors[0].value).data<float>()[5], 3);
  }
  EXPECT_LE(harmless, 8);
}

TEST_F(RunTest, OnlyFilesOfStepsAreCheckpoints) {
  for (const std::int64_t step : {99'999'999, 100'000'000}) {  // nine digits come after eight
    ASSERT_TRUE(SaveCheckpoint(folder_, {step, 64, "", 0}, SomeTensors(context_, 0)).ok());
  }
  Write("checkpoints/step_00000010_best.safetensors", "somebody's copy");
  EXPECT_EQ(LoadNewestCheckpoint(context_, folder_)->checkpoint.info.step, 100'000'000);
  PruneCheckpoints(folder_, 1);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "checkpoints/step_00000010_best.safetensors"));
}

TEST_F(RunTest, LogForgetsWhatCameAfterTheCheckpoint) {
  {
    auto log = Ok(RunLog::Open(folder_, 0));
    for (const std::int64_t step : {10, 20, 30}) {
      ASSERT_TRUE(log->Append({step, {{"loss", 1.0 / static_cast<double>(step)}}}).ok());
    }
  }
  ASSERT_TRUE(AppendText(folder_ / "metrics.jsonl", "{\"step\": 4", false).ok());  // cut by a crash
  auto log = Ok(RunLog::Open(folder_, 20));
  ASSERT_TRUE(log->Append({21, {{"loss", 7}}}).ok());
  const auto entries = Ok(ReadLog(folder_));
  ASSERT_EQ(entries->size(), 3u);
  EXPECT_EQ(entries->at(1).step, 20);
  EXPECT_EQ(entries->at(1).values[0].second, 1.0 / 20);  // numbers survive exactly
  EXPECT_EQ(entries->at(2).step, 21);
  Write("metrics.jsonl", "{\"step\":1}\nnonsense\n");
  ExpectMessage(ReadLog(folder_).status(), "metrics.jsonl", "line 2");
  for (const char* step : {"18446744073709551615", "-1", "1e999", "1.5", "null"}) {
    Write("metrics.jsonl", std::string("{\"step\":") + step + "}\n");
    ExpectMessage(ReadLog(folder_).status(), "metrics.jsonl", "line 1");
  }
}

TEST(Tensorboard, CrcAndFraming) {
  EXPECT_EQ(Crc32c("123456789"), 0xE3069283u);  // the check value of CRC-32C
  const std::string record = TensorboardScalarsRecord(1.0, 5, {{"loss", 0.5}});
  // u64 length, crc, event, crc. Event: 09 wall_time, 10 step, 2a summary {0a value {0a tag, 15
  // float}}.
  const std::string event = record.substr(12, record.size() - 16);
  EXPECT_EQ(static_cast<std::uint8_t>(record[0]), event.size());
  const unsigned char want[] = {0x09, 0,  0,    0, 0,   0,   0,   0xf0, 0x3f, 0x10, 5, 0x2a, 13,
                                0x0a, 11, 0x0a, 4, 'l', 'o', 's', 's',  0x15, 0,    0, 0,    0x3f};
  EXPECT_EQ(event, std::string(reinterpret_cast<const char*>(want), sizeof(want)));
}

TEST(Schedule, SamplesComeEarlyThenEvenlyAndAtTheEnd) {
  const auto due = [](const Schedule& schedule) {
    std::vector<std::int64_t> out;
    for (std::int64_t step = 0; step <= schedule.steps; ++step) {
      if (SampleIsDue(schedule, step)) out.push_back(step);
    }
    return out;
  };
  using Steps = std::vector<std::int64_t>;
  EXPECT_EQ(due({.steps = 250, .sample_every = 100}), (Steps{10, 20, 40, 80, 100, 200, 250}));
  EXPECT_EQ(due({.steps = 50, .sample_every = 20}), (Steps{10, 20, 40, 50}));
  EXPECT_EQ(due({.steps = 7, .sample_every = 3}), (Steps{3, 6, 7}));
}

TEST(BatchOrder, EveryEpochShowsEachModelOnceAndViewsAreDistinct) {
  BatchOrder order(10, 6, 3), again(10, 6, 3);
  std::multiset<int> seen;
  for (std::int64_t step = 0; step < 5; ++step) {
    for (const Sample& s : order.Batch(step, 4, 3)) {
      seen.insert(s.model);
      EXPECT_EQ(std::set<int>(s.views.begin(), s.views.end()).size(), 3u);
    }
  }
  for (int m = 0; m < 10; ++m) EXPECT_EQ(seen.count(m), 2u);
  // A pure function of the step: asking for step 4 alone gives the same.
  EXPECT_EQ(again.Batch(4, 4, 3)[2].views, order.Batch(4, 4, 3)[2].views);
}

TEST(BatchOrder, EveryOrderComesAsOftenAsAnyOther) {
  BatchOrder order(3, 1, 3);
  std::map<std::vector<int>, int> seen;
  for (std::int64_t epoch = 0; epoch < 600; ++epoch) {
    const auto batch = order.Batch(epoch, 3, 1);
    ++seen[{batch[0].model, batch[1].model, batch[2].model}];
  }
  // 600 throws of 1/6: five standard deviations are 46.
  EXPECT_EQ(seen.size(), 6u);
  for (const auto& [_, count] : seen) EXPECT_NEAR(count, 100, 46);
}

TEST(BatchOrder, MirrorsTheShareThatIsAskedForAndNothingElseChanges) {
  BatchOrder plain(10, 6, 3), some(10, 6, 3, 0.25), all(10, 6, 3, 1.0);
  int mirrored = 0;
  for (std::int64_t step = 0; step < 100; ++step) {
    const auto a = plain.Batch(step, 4, 2), b = some.Batch(step, 4, 2), c = all.Batch(step, 4, 2);
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].model, b[i].model);
      EXPECT_EQ(a[i].views, b[i].views);
      EXPECT_FALSE(a[i].mirrored);
      EXPECT_TRUE(c[i].mirrored);
      mirrored += b[i].mirrored;
    }
  }
  // 400 throws of 0.25: five standard deviations are 43.
  EXPECT_NEAR(mirrored, 100, 43);
}

TEST(MirroredCamera, SeesTheMirroredWorldFlipped) {
  const int size = 48;
  Lens lens;
  lens.width = lens.height = size;
  Camera camera = OrbitCamera(lens, 37, 21, 1.7);
  camera.cx += 3;
  camera.translation[0] = 0.25f;  // off the middle, and not towards it
  const Camera mirrored = MirroredCamera(camera, size);
  const auto project = [](const Camera& c, std::array<float, 3> p) {
    std::array<float, 3> q;
    for (std::size_t r = 0; r < 3; ++r) {
      q[r] = c.translation[r];
      for (std::size_t k = 0; k < 3; ++k) q[r] += c.rotation[3 * r + k] * p[k];
    }
    return std::array<float, 2>{c.cx + c.fx * q[0] / q[2], q[2]};
  };
  for (const auto& p : {std::array<float, 3>{0.3f, 0.1f, -0.2f}, {-0.4f, 0.2f, 0.4f}}) {
    const auto seen = project(camera, p), flipped = project(mirrored, {-p[0], p[1], p[2]});
    // Up to ten roundings of 2^-24 of numbers below 64 pixels and 2 units.
    EXPECT_NEAR(flipped[0], static_cast<float>(size) - seen[0], 4e-5);
    EXPECT_NEAR(flipped[1], seen[1], 1.2e-6);
  }
}

// Checkpoints that cannot be read and may be whole: a run stops there, and nothing is renamed.
// Damaged ones: run_test.cc, and how runs go on, trainer_test.cc.

class CheckpointTest : public TempFolderTest {
 protected:
  CheckpointTest() : workers_(1), context_(workers_) {
    for (const std::int64_t step : {10, 20}) {
      EXPECT_TRUE(SaveCheckpoint(folder_, {step, 64, "", 0}, Tensors()).ok());
    }
    newest_ = folder_ / "checkpoints/step_00000020.safetensors";
  }

  std::vector<nn::NamedTensor> Tensors() { return {{"w", context_.Full({3}, 1)}}; }

  // The newest checkpoint with another `key`; a tensor of a dtype that this version does not know.
  void Rewrite(const std::string& key, const std::string& value, bool other_dtype = false) {
    nn::TensorFile file =
        nn::ReadSafetensors(context_, folder_ / "checkpoints/step_00000010.safetensors").value();
    file.metadata[key] = value;
    Bytes bytes = nn::EncodeSafetensors(file).value();
    std::string text(bytes.begin(), bytes.end());
    if (other_dtype) text.replace(text.find("\"F32\""), 5, "\"B32\"");
    Write("checkpoints/step_00000020.safetensors", text);
  }

  // Neither an older checkpoint nor none, and all files as they are.
  void ExpectStops(const std::string& reason) {
    std::vector<Path> before = Files();
    ExpectMessage(LoadNewestCheckpoint(context_, folder_).status(), "step_00000020", reason,
                  "nothing was changed", "move this file away");
    EXPECT_EQ(Files(), before);
  }
  std::vector<Path> Files() const {
    std::set<Path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "checkpoints"))
      files.insert(entry.path());
    return {files.begin(), files.end()};
  }

  Workers workers_;
  nn::Context context_;
  Path newest_;
};

TEST_F(CheckpointTest, AnotherVersionsIsNotDamaged) {
  Rewrite("format", "tilegrad-checkpoint-2");
  ExpectStops("another version");
  Rewrite("format", "tilegrad-checkpoint-2", /*other_dtype=*/true);
  ExpectStops("\"tilegrad-checkpoint-2\"");
  Rewrite("format", "somebody's");
  ExpectStops("not a checkpoint of tilegrad");
}

TEST_F(CheckpointTest, OneThatTheSystemDoesNotGiveIsNotDamaged) {
  std::filesystem::remove(newest_);
  std::filesystem::create_symlink(newest_, newest_);  // also stops root, unlike permissions
  ExpectStops("cannot open");
  std::filesystem::remove(newest_);
  std::filesystem::create_directory(newest_);
  ExpectStops("not a regular file");
}

TEST_F(CheckpointTest, OneAboveTheLimitIsNotDamaged) {
  std::filesystem::resize_file(newest_, (std::size_t{4} << 30) + 1);  // without taking space
  ExpectStops("more than the limit");
}

TEST_F(CheckpointTest, NoFileHandleIsNoDamage) {
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  nn::Context& context = context_;
  const Path folder = folder_, newest = newest_;  // UBSan cannot look at *this without a handle
  const rlimit none = {3, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Status status = LoadNewestCheckpoint(context, folder).status();
  const auto alone = LoadCheckpoint(context, newest).status();
  ::setrlimit(RLIMIT_NOFILE, &before);
  ExpectMessage(status, "cannot list", "nothing was changed");
  EXPECT_EQ(status.code(), StatusCode::kIo);
  EXPECT_EQ(alone.code(), StatusCode::kIo);
  EXPECT_TRUE(LoadNewestCheckpoint(context_, folder_).ok());
}

TEST_F(CheckpointTest, AFolderThatCannotBeListedIsNoNewRun) {
  std::filesystem::remove_all(folder_ / "checkpoints");
  EXPECT_EQ(LoadNewestCheckpoint(context_, folder_).status().code(), StatusCode::kNotFound);
  std::filesystem::create_symlink(folder_ / "checkpoints", folder_ / "checkpoints");
  ExpectMessage(LoadNewestCheckpoint(context_, folder_).status(), "checkpoints", "cannot list");
}

}  // namespace tilegrad::train::run_test
