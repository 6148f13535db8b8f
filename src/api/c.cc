// SPDX-License-Identifier: Apache-2.0
#include "tilegrad/c.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <string>
#include <vector>

#include "api/c_records.h"
#include "base/error.h"

using tilegrad::InvalidArgument;
using tilegrad::Status;
using tilegrad::StatusCode;
namespace api = tilegrad::api;

struct tilegrad_renderer {
  explicit tilegrad_renderer(int32_t threads) : renderer({threads}) {}

  tilegrad::Renderer renderer;
  std::string error;
  std::vector<tilegrad_scene_gradients> wanted;
  std::vector<api::CGradients> gradients;
  std::vector<tilegrad::SceneGradients> views;
};

struct tilegrad_frame {
  tilegrad::Frame frame;
  std::vector<api::CScene> scenes;  // of the last render, and spare ones
  std::size_t count = 0;
  std::vector<tilegrad::Scene> views;
};

namespace {

tilegrad_status CodeOf(const Status& status) {
  switch (status.code()) {
    case StatusCode::kOk:
      return TILEGRAD_OK;
    case StatusCode::kInvalidArgument:
      return TILEGRAD_INVALID_ARGUMENT;
    case StatusCode::kResourceExhausted:
      return TILEGRAD_RESOURCE_EXHAUSTED;
    default:
      return TILEGRAD_INTERNAL;
  }
}

// Runs a call and stores its error message.
template <class Call>
tilegrad_status Run(tilegrad_renderer* renderer, const Call& call) {
  if (renderer == nullptr) return TILEGRAD_INVALID_ARGUMENT;
  Status status = tilegrad::Guarded(call);
  const Status kept = tilegrad::Guarded([&]() -> Status {
    renderer->error = status.message();
    return {};
  });
  return CodeOf(kept.ok() ? status : kept);
}

tilegrad_scene DefaultScene() {
  tilegrad_scene scene = {};
  scene.camera = api::CameraOf(tilegrad::Camera());
  return scene;
}

tilegrad_options DefaultOptions() {
  const tilegrad::RenderOptions from;
  tilegrad_options to = {};
  to.width = from.width;
  to.height = from.height;
  to.delta = from.delta;
  to.max_alpha_error = from.max_alpha_error;
  to.paper_box = from.paper_box;
  to.paper_faces = from.paper_faces;
  to.color = to.alpha = to.attributes = 1;
  return to;
}

// Writes as much of `value` as the caller's struct holds; nothing if `to` is null.
template <class S>
void WriteSized(S value, std::size_t size, S* to) {
  if (to == nullptr) return;
  value.struct_size = size;
  std::memset(to, 0, size);
  std::memcpy(to, &value, std::min(size, sizeof(S)));
}

Status ReadScenes(const tilegrad_scene* scenes, std::size_t count, tilegrad_frame* frame) {
  frame->count = 0;
  frame->views.clear();
  TILEGRAD_TRY(api::CheckCount("count", count));
  for (std::size_t n = 0; n < count; ++n) {
    tilegrad_scene scene = DefaultScene();
    Status status = api::ReadEntry("scene", scenes, n, &scene);
    if (status.ok()) status = api::CheckCounts(scene);
    if (!status.ok()) return status.Within(fmt::format("scene {}", n));
    // One by one: a wrong count fails at the first bad entry, before it takes memory.
    if (frame->scenes.size() <= n) frame->scenes.emplace_back();
    frame->scenes[n].Set(scene);
    frame->views.push_back(frame->scenes[n].scene);
  }
  frame->count = count;
  return {};
}

Status Backward(tilegrad_renderer* r, const tilegrad_frame* frame,
                const tilegrad_frame_gradients* d_frame, const tilegrad_scene_gradients* d_scenes,
                std::size_t count, bool add) {
  if (frame == nullptr) return InvalidArgument("frame is NULL");
  if (frame->frame.images().width == 0) {
    return InvalidArgument("the frame holds nothing: Render into it first");
  }
  if (count != frame->count) {
    return InvalidArgument("count is {}, expected {}: one per scene", count, frame->count);
  }
  tilegrad_frame_gradients d_images = {};
  TILEGRAD_TRY(api::ReadSized("d_frame", d_frame, &d_images));
  r->wanted.assign(count, {});
  if (r->gradients.size() < count) r->gradients.resize(count);
  r->views.clear();
  for (std::size_t n = 0; n < count; ++n) {
    Status status = api::ReadEntry("d_scene", d_scenes, n, &r->wanted[n]);
    if (status.ok()) status = api::CheckRequested(r->wanted[n], frame->views[n]);
    if (!status.ok()) return status.Within(fmt::format("scene {}", n));
    r->gradients[n].Set(r->wanted[n], frame->views[n]);
    r->views.push_back(r->gradients[n].gradients);
  }
  TILEGRAD_TRY(r->renderer.Backward(
      frame->frame, api::FrameGradientsOf(d_images, frame->frame.images()), r->views,
      add ? tilegrad::GradientMode::kAdd : tilegrad::GradientMode::kOverwrite));
  for (std::size_t n = 0; n < count && !add; ++n) {
    api::CGradients::Clear(r->wanted[n], frame->views[n]);
  }
  bool finite = true;
  for (std::size_t n = 0; n < count; ++n) finite &= r->gradients[n].AddTo(r->wanted[n]);
  return finite ? Status() : InvalidArgument("a sum of gradients overflows");
}

}  // namespace

extern "C" {

const char* tilegrad_version(void) { return TILEGRAD_VERSION; }

tilegrad_renderer* tilegrad_renderer_create(int32_t threads) {
  return new (std::nothrow) tilegrad_renderer(threads);
}
void tilegrad_renderer_destroy(tilegrad_renderer* renderer) { delete renderer; }
tilegrad_frame* tilegrad_frame_create(void) { return new (std::nothrow) tilegrad_frame; }
void tilegrad_frame_destroy(tilegrad_frame* frame) { delete frame; }

const char* tilegrad_last_error(const tilegrad_renderer* renderer) {
  return renderer == nullptr ? "renderer is NULL" : renderer->error.c_str();
}

void tilegrad_scene_init_sized(tilegrad_scene* scene, size_t size) {
  WriteSized(DefaultScene(), size, scene);
}
void tilegrad_options_init_sized(tilegrad_options* options, size_t size) {
  WriteSized(DefaultOptions(), size, options);
}
void tilegrad_images_init_sized(tilegrad_images* images, size_t size) {
  WriteSized({}, size, images);
}
void tilegrad_frame_gradients_init_sized(tilegrad_frame_gradients* d, size_t size) {
  WriteSized({}, size, d);
}
void tilegrad_scene_gradients_init_sized(tilegrad_scene_gradients* d, size_t size) {
  WriteSized({}, size, d);
}

tilegrad_status tilegrad_render(tilegrad_renderer* renderer, const tilegrad_scene* scenes,
                                size_t count, const tilegrad_options* options,
                                tilegrad_frame* frame) {
  return Run(renderer, [&]() -> Status {
    if (frame == nullptr) return InvalidArgument("frame is NULL");
    tilegrad_options known = DefaultOptions();
    Status status = tilegrad::Guarded([&]() -> Status {
      TILEGRAD_TRY(api::ReadSized("options", options, &known));
      return ReadScenes(scenes, count, frame);
    });
    if (!status.ok()) {
      frame->frame = {};
      frame->count = 0;
      return status;
    }
    return renderer->renderer.Render(frame->views, api::OptionsOf(known), api::OutputsOf(known),
                                     &frame->frame);
  });
}

tilegrad_status tilegrad_frame_images(const tilegrad_frame* frame, tilegrad_images* images) {
  if (frame == nullptr || images == nullptr) return TILEGRAD_INVALID_ARGUMENT;
  const std::size_t size = images->struct_size;
  const Status status = tilegrad::Guarded([&] { return api::CheckStructSize("images", size); });
  if (status.ok()) WriteSized(api::ImagesOf(frame->frame.images()), size, images);
  return CodeOf(status);
}

tilegrad_status tilegrad_backward(tilegrad_renderer* renderer, const tilegrad_frame* frame,
                                  const tilegrad_frame_gradients* d_frame,
                                  const tilegrad_scene_gradients* d_scenes, size_t count,
                                  int32_t add) {
  return Run(renderer,
             [&] { return Backward(renderer, frame, d_frame, d_scenes, count, add != 0); });
}

}  // extern "C"
