// SPDX-License-Identifier: Apache-2.0
// A program that loads the library, as plug-ins are, renders on two threads and closes it. The
// threads sleep on, so its code, and oneTBB's, has to stay.
#include <dlfcn.h>
#include <tilegrad/c.h>

#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#define FROM(library, name) reinterpret_cast<decltype(&name)>(dlsym(library, #name))

static tilegrad_status Render(void* library) {
  const float positions[9] = {-0.5f, -0.4f, -2, 0.5f, -0.4f, -2, 0, 0.6f, -2};
  const int32_t faces[3] = {0, 1, 2};
  tilegrad_scene scene;
  FROM(library, tilegrad_scene_init_sized)(&scene, sizeof scene);
  scene.positions = positions;
  scene.vertices = 3;
  scene.faces = faces;
  scene.face_count = 1;
  const std::vector<tilegrad_scene> scenes(8, scene);
  tilegrad_options options;
  FROM(library, tilegrad_options_init_sized)(&options, sizeof options);
  tilegrad_renderer* renderer = FROM(library, tilegrad_renderer_create)(2);
  tilegrad_frame* frame = FROM(library, tilegrad_frame_create)();
  const tilegrad_status status =
      FROM(library, tilegrad_render)(renderer, scenes.data(), scenes.size(), &options, frame);
  FROM(library, tilegrad_frame_destroy)(frame);
  FROM(library, tilegrad_renderer_destroy)(renderer);
  return status;
}

int main(int, char** arguments) {
  for (int i = 0; i < 2; ++i) {
    void* library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr || Render(library) != TILEGRAD_OK || dlclose(library) != 0) return 1;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  std::puts("closed twice");
}
