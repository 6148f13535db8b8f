// SPDX-License-Identifier: Apache-2.0
// The program with too few file handles or too little memory, and stopped by signals: models are as
// sound as they were.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <thread>

#include "base/sanitizers.h"
#include "io/glb_writer.h"
#include "io/image_file.h"
#include "scene/shapes.h"
#include "support/run_program.h"

namespace tilegrad::resources_test {

class Resources : public ProgramTest {
 protected:
  // Three models with side files, of readers in this process and in one of their own.
  void WriteModels() {
    ImageU8 image(8, 8, 3);
    for (const char* name : {"a", "b", "c"}) {
      const std::string stem = std::string("in/thing/") + name;
      Write(stem + ".obj", "mtllib " + std::string(name) +
                               ".mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\n"
                               "f 1/1 2/1 3/1\nf 1/1 3/1 4/1\nf 1/1 4/1 2/1\n");
      Write(stem + ".mtl", "newmtl m\nKd 1 0 0\nmap_Kd " + std::string(name) + ".png\n");
      ASSERT_TRUE(io::SavePng(folder_ / (stem + ".png"), image).ok());
    }
    ASSERT_TRUE(io::SaveGlb(folder_ / "in/thing/d.glb", Icosphere(0, 1)).ok());
  }

  // Makes the dataset under `limit`, a command of the shell. What was made has all models and no
  // warning; else a sentence names what is lacking, and the same command without the limit goes on.
  // Returns whether it was made.
  bool Make(const std::string& limit) {
    const Path out = folder_ / "out";
    const std::string arguments =
        "dataset --source folder --workers 2 --size 16 --views 2 --input " +
        (folder_ / "in").string() + " --out " + out.string();
    const Outcome outcome = RunProgram(arguments, limit + "; exec ");
    if (outcome.exit_code == 0) {
      EXPECT_NE(outcome.output.find("4 models"), std::string::npos) << limit << outcome.output;
      EXPECT_EQ(outcome.output.find("could not be used"), std::string::npos)
          << limit << outcome.output;
      EXPECT_EQ(outcome.output.find("while reading models"), std::string::npos)
          << limit << outcome.output;
    } else {
      EXPECT_GT(outcome.exit_code, 0) << "a signal: " << limit << outcome.output;
      const auto rejected = ReadText(out / "rejected.jsonl");
      EXPECT_TRUE(!rejected.ok() || rejected->empty()) << limit << *rejected;
      EXPECT_EQ(outcome.output.find("damaged"), std::string::npos) << limit << outcome.output;
      EXPECT_EQ(RunProgram(arguments).exit_code, 0) << limit;
    }
    std::filesystem::remove_all(out);
    return outcome.exit_code == 0;
  }
};

TEST_F(Resources, FewFileHandlesAreNoDamage) {
  WriteModels();
  int made = 0, refused = 0;
  for (int handles = 4; handles <= 20; ++handles) {
    (Make("ulimit -n " + std::to_string(handles)) ? made : refused) += 1;
  }
  EXPECT_GT(made, 0);
  EXPECT_GT(refused, 0);
}

TEST_F(Resources, LittleMemoryIsNoDamage) {
  if (kSanitizer) GTEST_SKIP() << "sanitizers reserve terabytes";
  WriteModels();
  for (int megabytes = 200; megabytes <= 600; megabytes += 50) {
    (void)Make("ulimit -v " + std::to_string(megabytes << 10));
  }
  EXPECT_TRUE(Make("ulimit -v " + std::to_string(4 << 20)));
}

// A mesh whose reader takes seconds.
class Signals : public ProgramTest {
 protected:
  static std::size_t ResidentBytes(pid_t process) {
    std::ifstream file("/proc/" + std::to_string(process) + "/statm");
    std::size_t all = 0, resident = 0;
    file >> all >> resident;
    return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  }

  static bool Catches(pid_t process, int signal) {
    std::ifstream file("/proc/" + std::to_string(process) + "/status");
    std::uint64_t caught = 0;
    for (std::string word; file >> word;) {
      if (word == "SigCgt:") file >> std::hex >> caught;
    }
    return (caught >> (signal - 1) & 1) != 0;
  }

  // The program's exit code after `signal`, sent once its reader works, and how long it took then.
  std::pair<int, double> Stop(int signal) {
    std::string stl = "solid x\n";
    for (int i = 0; i < 400'000; ++i) {
      stl += "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 " + std::to_string(i) +
             "\nvertex 0 1 0\nendloop\nendfacet\n";
    }
    const std::string file = Write("large.stl", stl + "endsolid x\n").string(),
                      out = (folder_ / "out.png").string();
    const std::size_t bytes = stl.size();
    std::string().swap(stl);  // a child has its parent's memory at first
    const pid_t child = ::fork();
    if (child == 0) {
      ::execl(TILEGRAD_PROGRAM, TILEGRAD_PROGRAM, "render", file.c_str(), "--out", out.c_str(),
              "--size", "4096", nullptr);
      ::_exit(127);
    }
    // Until it has the file. Sanitizers' own memory is large from the start on.
    while (ResidentBytes(child) < bytes || !Catches(child, signal)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (::waitpid(child, nullptr, WNOHANG) == child) return {-1, 0};
    }
    const auto start = std::chrono::steady_clock::now();
    ::kill(child, signal);
    int status = 0;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), seconds.count()};
  }
};

TEST_F(Signals, StopAReaderAtOnceWithTheirOwnCode) {
  for (const auto& [signal, code] : {std::pair(SIGINT, 130), std::pair(SIGTERM, 143)}) {
    const auto [got, seconds] = Stop(signal);
    EXPECT_EQ(got, code);
    EXPECT_LT(seconds, 2);
  }
}

}  // namespace tilegrad::resources_test
