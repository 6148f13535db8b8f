// SPDX-License-Identifier: Apache-2.0
// The program itself, as a person starts it.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "scene/mesh.h"
#include "support/temp_folder.h"

namespace tilegrad {

struct Outcome {
  int exit_code = -1;  // -1: ended by a signal
  std::string output;  // both streams
};

// `before`: what the shell does first.
inline Outcome RunProgram(const std::string& arguments, const std::string& before = "") {
  Outcome outcome;
  std::FILE* pipe = ::popen((before + TILEGRAD_PROGRAM + " " + arguments + " 2>&1").c_str(), "r");
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  return outcome;
}

// A GAN of two steps, shapes only.
inline constexpr const char* kTwoStepGan = R"(name = "gan"
[task]
kind = "gan"
[network]
noise = 4
shape_noise = 2
hidden = 8
template_level = 1
texture_size = 16
texture_base = 2
texture_most = 4
output_deviation = 0.1
[critic]
views = 1
base = 2
halvings = 2
[stages]
shape = 2
[textures]
count = 8
[score]
count = 8
[schedule]
steps = 2
batch = 2
)";

// As an OBJ file has it, each vertex where `place` puts it.
template <class Place>
std::string ObjText(const Mesh& mesh, const Place& place) {
  std::string out;
  for (const glm::vec3& p : mesh.positions) {
    const glm::dvec3 q = place(p);
    out += fmt::format("v {:.6f} {:.6f} {:.6f}\n", q.x, q.y, q.z);
  }
  for (const auto& [a, b, c] : mesh.faces) out += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  return out;
}

// A fixture that runs the program, with its own folder.
class ProgramTest : public TempFolderTest {
 protected:
  std::string In(const std::string& name) const { return (folder_ / name).string(); }
  bool Exists(const std::string& name) const { return PathExists(folder_ / name); }

  // Returns its output.
  static std::string ExpectDone(const std::string& arguments, const std::string& before = "") {
    const Outcome outcome = RunProgram(arguments, before);
    EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.output;
    return outcome.output;
  }
  // Its output has all `parts`.
  template <class... Parts>
  static void ExpectRefused(const Outcome& outcome, int code, const Parts&... parts) {
    EXPECT_EQ(outcome.exit_code, code) << outcome.output;
    if constexpr (sizeof...(parts) > 0) ExpectIn(outcome.output, parts...);
  }
  template <class... Parts>
  static void ExpectRefused(const std::string& arguments, int code, const Parts&... parts) {
    SCOPED_TRACE(arguments);
    ExpectRefused(RunProgram(arguments), code, parts...);
  }
  // Any error code, but neither a signal nor a failure of the shell itself.
  template <class... Parts>
  static void ExpectError(const std::string& arguments, const Parts&... parts) {
    const Outcome outcome = RunProgram(arguments);
    EXPECT_TRUE(outcome.exit_code > 0 && outcome.exit_code < 126) << arguments << outcome.output;
    if constexpr (sizeof...(parts) > 0) ExpectIn(outcome.output, parts...);
  }

  // A dataset of procedural models, and two steps of a tiny network on it. Names are shell words.
  static void MakeData(const std::string& data) {
    ExpectDone("dataset --source procedural --per-class 2 --size 16 --views 3 --out " + data);
  }
  static std::string TrainTiny(const std::string& data, const std::string& run,
                               const std::string& config = "quick") {
    return "train --config " + config + " --data " + data + " --out " + run +
           " --set schedule.steps=2 --set schedule.batch=4 --set network.channels=2 --set "
           "network.code=8 --set network.hidden1=8 --set network.hidden2=8 --set "
           "network.template_level=1";
  }
  static void MakeRun(const std::string& data, const std::string& run) {
    ExpectDone(TrainTiny(data, run));
  }
};

}  // namespace tilegrad
