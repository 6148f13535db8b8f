/* SPDX-License-Identifier: Apache-2.0 */
/* hello_triangle.cc in C: the area of a triangle's silhouette, and its gradient. */
#include <stdio.h>
#include <tilegrad/c.h>

enum { kSize = 64, kPixels = kSize * kSize };

static int Failed(const tilegrad_renderer* renderer, const char* call) {
  fprintf(stderr, "%s: %s\n", call, tilegrad_last_error(renderer));
  return 1;
}

static int Run(tilegrad_renderer* renderer, tilegrad_frame* frame) {
  static const float positions[9] = {-0.5f, -0.4f, -2, 0.5f, -0.4f, -2, 0, 0.6f, -2};
  static const int32_t faces[3] = {0, 1, 2};
  static float d_alpha[kPixels];
  float d_positions[9], area = 0;
  tilegrad_scene scene;
  tilegrad_options options;
  tilegrad_images images;
  tilegrad_frame_gradients d_frame;
  tilegrad_scene_gradients d_scene;
  int i;

  tilegrad_scene_init(&scene);
  scene.positions = positions;
  scene.vertices = 3;
  scene.faces = faces;
  scene.face_count = 1;
  tilegrad_options_init(&options);
  options.width = options.height = kSize;
  options.delta = 1e-3;
  if (tilegrad_render(renderer, &scene, 1, &options, frame) != TILEGRAD_OK) {
    return Failed(renderer, "tilegrad_render");
  }
  tilegrad_images_init(&images);
  if (tilegrad_frame_images(frame, &images) != TILEGRAD_OK) return 1;
  for (i = 0; i < kPixels; ++i) {
    area += images.alpha[i];
    d_alpha[i] = 1;
  }

  tilegrad_frame_gradients_init(&d_frame);
  d_frame.alpha = d_alpha;
  tilegrad_scene_gradients_init(&d_scene);
  d_scene.positions = d_positions;
  if (tilegrad_backward(renderer, frame, &d_frame, &d_scene, 1, 0) != TILEGRAD_OK) {
    return Failed(renderer, "tilegrad_backward");
  }
  printf("tilegrad %s: %.1f pixels; moving the top up adds %.1f for each unit\n",
         tilegrad_version(), area, d_positions[7]);
  return d_positions[7] > 0 && d_positions[1] < 0 ? 0 : 1;
}

int main(void) {
  tilegrad_renderer* renderer = tilegrad_renderer_create(0);
  tilegrad_frame* frame = tilegrad_frame_create();
  const int result = renderer != NULL && frame != NULL ? Run(renderer, frame) : 1;
  tilegrad_frame_destroy(frame);
  tilegrad_renderer_destroy(renderer);
  return result;
}
