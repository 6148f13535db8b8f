// SPDX-License-Identifier: Apache-2.0
// The C++ side of call_overhead.py: renders a batch as often as a line of its input says, through
// the public interface, and prints what that took.
//   call_server BATCH THREADS
// BATCH: int32 images, vertices, faces, size; float32 positions [images,vertices,3], colors
// [vertices,3], cameras [images,17]; int32 faces [faces,3]; float32 d_color, d_alpha.
#include <tilegrad/tilegrad.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

namespace {

constexpr std::size_t kCamera = 17;

template <class T>
std::vector<T> Read(std::ifstream& from, std::size_t count) {
  std::vector<T> out(count);
  from.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(count * sizeof(T)));
  return out;
}

tilegrad::Camera CameraOf(const float* numbers) {
  tilegrad::Camera out;
  std::copy_n(numbers, 9, out.rotation);
  std::copy_n(numbers + 9, 3, out.translation);
  out.fx = numbers[12];
  out.fy = numbers[13];
  out.cx = numbers[14];
  out.cy = numbers[15];
  out.near_plane = numbers[16];
  return out;
}

struct Batch {
  std::size_t images, vertices;
  int size;
  std::vector<float> positions, colors, cameras, d_color, d_alpha, d_positions, d_colors;
  std::vector<std::int32_t> faces;
};

Batch ReadBatch(const char* path) {
  std::ifstream file(path, std::ios::binary);
  const auto sizes = Read<std::int32_t>(file, 4);
  Batch b;
  b.images = static_cast<std::size_t>(sizes[0]);
  b.vertices = static_cast<std::size_t>(sizes[1]);
  b.size = sizes[3];
  b.positions = Read<float>(file, b.images * b.vertices * 3);
  b.colors = Read<float>(file, b.vertices * 3);
  b.cameras = Read<float>(file, b.images * kCamera);
  b.faces = Read<std::int32_t>(file, static_cast<std::size_t>(sizes[2]) * 3);
  const std::size_t pixels = b.images * static_cast<std::size_t>(b.size) * b.size;
  b.d_color = Read<float>(file, 3 * pixels);
  b.d_alpha = Read<float>(file, pixels);
  b.d_positions.resize(b.positions.size());
  b.d_colors.resize(b.colors.size());
  if (!file) std::exit(2);
  return b;
}

// One step, as a program would write it.
tilegrad::Status Step(Batch& b, bool backward, tilegrad::Renderer& renderer,
                      tilegrad::Frame& frame) {
  std::vector<tilegrad::Scene> scenes(b.images);
  std::vector<tilegrad::SceneGradients> gradients(b.images);
  const std::size_t each = 3 * b.vertices;
  for (std::size_t n = 0; n < b.images; ++n) {
    scenes[n] = {.positions = std::span(b.positions).subspan(n * each, each),
                 .faces = b.faces,
                 .camera = CameraOf(&b.cameras[n * kCamera]),
                 .colors = {b.colors}};
    gradients[n].positions = std::span(b.d_positions).subspan(n * each, each);
    gradients[n].colors = b.d_colors;
  }
  TILEGRAD_TRY(renderer.Render(scenes, {.width = b.size, .height = b.size}, {}, &frame));
  if (!backward) return {};
  return renderer.Backward(frame, {.color = b.d_color, .alpha = b.d_alpha}, gradients);
}

double CpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: call_server BATCH THREADS\n");
    return 2;
  }
  Batch batch = ReadBatch(argv[1]);
  tilegrad::Renderer renderer({.threads = std::atoi(argv[2])});
  tilegrad::Frame frame;
  int backward = 0, steps = 0;
  while (std::cin >> backward >> steps) {
    const auto wall = std::chrono::steady_clock::now();
    const double cpu = CpuSeconds();
    for (int i = 0; i < steps; ++i) {
      const tilegrad::Status status = Step(batch, backward != 0, renderer, frame);
      if (!status.ok()) {
        std::fprintf(stderr, "%s\n", status.message().c_str());
        return 1;
      }
    }
    const double cpu_seconds = CpuSeconds() - cpu;
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - wall;
    std::printf("%.9f %.9f\n", seconds.count(), cpu_seconds);
    std::fflush(stdout);
  }
}
