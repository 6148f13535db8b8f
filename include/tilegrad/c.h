/* SPDX-License-Identifier: Apache-2.0 */
/* The C interface of tilegrad, in float; for C99 or later and all languages that call C: Rust,
 * Julia, ctypes. Meanings, shapes and conventions are those of renderer.h and scene.h; a pointer
 * and a count replace a span, NULL and 0 an empty one.
 *
 * Large structs begin with their size, which tells the library which version the caller was
 * compiled with: new members come only at the end, and those that a caller does not know have their
 * defaults. Call a struct's tilegrad_..._init first. All structs of an array have the same size.
 * Structs without a size never change.
 *
 * Nothing here prints, aborts or throws. One call at a time per renderer.
 */
#ifndef TILEGRAD_C_H_
#define TILEGRAD_C_H_

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TILEGRAD_C_API __attribute__((visibility("default")))

typedef enum tilegrad_status {
  TILEGRAD_OK = 0,
  TILEGRAD_INVALID_ARGUMENT = 1,   /* the caller's value is wrong */
  TILEGRAD_RESOURCE_EXHAUSTED = 2, /* larger than the memory or the limit allows */
  TILEGRAD_INTERNAL = 3            /* a bug in the library */
} tilegrad_status;

typedef struct tilegrad_renderer tilegrad_renderer; /* threads and scratch memory */
typedef struct tilegrad_frame tilegrad_frame;       /* images, and what backward needs */

TILEGRAD_C_API const char* tilegrad_version(void); /* "0.2.0" */

/* threads: 0..1024; 0: one per core; 1: only the caller's. Other numbers are an error of the first
 * call. Returns NULL if out of memory. */
TILEGRAD_C_API tilegrad_renderer* tilegrad_renderer_create(int32_t threads);
TILEGRAD_C_API void tilegrad_renderer_destroy(tilegrad_renderer* renderer);
TILEGRAD_C_API tilegrad_frame* tilegrad_frame_create(void);
TILEGRAD_C_API void tilegrad_frame_destroy(tilegrad_frame* frame);

/* The error of the last call, "" if none; valid until the next call with this renderer. */
TILEGRAD_C_API const char* tilegrad_last_error(const tilegrad_renderer* renderer);

typedef struct tilegrad_camera {
  float rotation[9];    /* row-major, world to camera: x right, y up, looking along -z */
  float translation[3]; /* world units */
  float fx, fy, cx, cy; /* pixels; fx, fy not 0, negative ones mirror */
  float near_plane;     /* world units, > 0 */
} tilegrad_camera;

typedef struct tilegrad_stream {
  const float* values; /* [V,C], or [F,3,C] with per_corner */
  int32_t per_corner;  /* 0 or 1 */
} tilegrad_stream;

typedef struct tilegrad_texture {
  const float* texels; /* [height,width,3], row 0 on top */
  int32_t width, height;
  int32_t wrap;   /* 0 repeat, 1 clamp, 2 mirror; different modes along u, v: 3 repeat clamp,
                     4 clamp mirror, 5 mirror repeat, 6 repeat mirror, 7 clamp repeat,
                     8 mirror clamp */
  int32_t filter; /* 0 nearest, 1 bilinear, 2 trilinear */
} tilegrad_texture;

typedef struct tilegrad_light {
  float direction[3]; /* from the surface to the light, world, not 0 */
  float intensity;
} tilegrad_light;

typedef struct tilegrad_surface {
  float base_color[3], ambient[3], diffuse[3], specular[3], shininess;
  int32_t texture; /* index, -1: none */
} tilegrad_surface;

typedef struct tilegrad_scene {
  size_t struct_size;
  const float* positions; /* [vertices,3] */
  size_t vertices;
  const int32_t* faces; /* [face_count,3] */
  size_t face_count;
  tilegrad_camera camera;
  tilegrad_stream colors, uvs, normals, attributes; /* C = 3, 2, 3, channels */
  int32_t channels;                                 /* > 0 with attributes */
  const tilegrad_texture* textures;
  size_t texture_count;
  const tilegrad_surface* surfaces; /* NULL: the default, with texture 0 if there is one */
  size_t surface_count;
  const int32_t* face_surfaces; /* [face_count] */
  int32_t lighting;             /* 0 none, 1 Lambert, 2 Phong, 3 spherical harmonics */
  int32_t normal_kind;          /* 0 smooth, 1 flat, 2 given */
  int32_t two_sided, clamp;     /* 0 or 1 */
  const tilegrad_light* lights;
  size_t light_count;
  const float* light_directions; /* [vertices,3] */
  const float* sh;               /* [9] */
} tilegrad_scene;

typedef struct tilegrad_options {
  size_t struct_size;
  int32_t width, height;  /* pixels */
  double delta;           /* NDC squared: softness of silhouettes */
  double max_alpha_error; /* absolute, [0, 1] */
  int32_t interpolation;  /* 0 perspective, 1 screen-linear */
  int32_t culling;        /* 0 none, 1 back faces */
  int32_t alpha_rule;     /* 0 all faces, 1 as in the paper's implementations */
  double paper_box;
  int32_t paper_faces;
  /* Which images to compute: 0 or 1. */
  int32_t color, alpha, attributes, depth, normals, uv, barycentrics;
} tilegrad_options;

/* Views of a frame, valid until the next render into it; NULL: not requested. N images, row 0 on
 * top. */
typedef struct tilegrad_images {
  size_t struct_size;
  int32_t count, height, width, channels;
  const int32_t* face_ids;   /* [N,H,W], -1 is background */
  const float* color;        /* [N,3,H,W] */
  const float* alpha;        /* [N,H,W] */
  const float* attributes;   /* [N,channels,H,W] */
  const float* depth;        /* [N,H,W], +infinity is background */
  const float* normals;      /* [N,3,H,W] */
  const float* uv;           /* [N,2,H,W] */
  const float* barycentrics; /* [N,2,H,W] */
  double alpha_error_bound;
} tilegrad_images;

/* dL/d(image), in the shapes of tilegrad_images; NULL is zero. */
typedef struct tilegrad_frame_gradients {
  size_t struct_size;
  const float *color, *alpha, *attributes, *depth, *normals, *uv;
} tilegrad_frame_gradients;

/* dL/d(scene), in the shapes of tilegrad_scene; NULL is not computed. Requesting a gradient of what
 * the scene does not have is an error. */
typedef struct tilegrad_scene_gradients {
  size_t struct_size;
  float* positions;
  tilegrad_camera* camera;
  float *colors, *uvs, *normals, *attributes, *light_directions, *sh;
  float* const* textures;     /* [texture_count]; NULL entries are not computed */
  tilegrad_surface* surfaces; /* [surface_count], [1] if the scene has none */
  tilegrad_light* lights;     /* [light_count] */
} tilegrad_scene_gradients;

/* Set defaults and struct_size: tilegrad_scene_init(&scene). */
#define tilegrad_scene_init(scene) tilegrad_scene_init_sized((scene), sizeof(tilegrad_scene))
#define tilegrad_options_init(options) \
  tilegrad_options_init_sized((options), sizeof(tilegrad_options))
#define tilegrad_images_init(images) tilegrad_images_init_sized((images), sizeof(tilegrad_images))
#define tilegrad_frame_gradients_init(d_frame) \
  tilegrad_frame_gradients_init_sized((d_frame), sizeof(tilegrad_frame_gradients))
#define tilegrad_scene_gradients_init(d_scene) \
  tilegrad_scene_gradients_init_sized((d_scene), sizeof(tilegrad_scene_gradients))
TILEGRAD_C_API void tilegrad_scene_init_sized(tilegrad_scene* scene, size_t size);
TILEGRAD_C_API void tilegrad_options_init_sized(tilegrad_options* options, size_t size);
TILEGRAD_C_API void tilegrad_images_init_sized(tilegrad_images* images, size_t size);
TILEGRAD_C_API void tilegrad_frame_gradients_init_sized(tilegrad_frame_gradients* d, size_t size);
TILEGRAD_C_API void tilegrad_scene_gradients_init_sized(tilegrad_scene_gradients* d, size_t size);

/* Renders `count` scenes. Their arrays must stay alive and unchanged until the last backward. */
TILEGRAD_C_API tilegrad_status tilegrad_render(tilegrad_renderer* renderer,
                                               const tilegrad_scene* scenes, size_t count,
                                               const tilegrad_options* options,
                                               tilegrad_frame* frame);

/* Fills `images` with views of the frame; all NULL before the first render and after an error. */
TILEGRAD_C_API tilegrad_status tilegrad_frame_images(const tilegrad_frame* frame,
                                                     tilegrad_images* images);

/* `count` gradients, one per scene of the frame. add: 0 overwrites the arrays, 1 adds to them; an
 * error then leaves them unchanged, unless a sum in a camera, surface or light overflows. */
TILEGRAD_C_API tilegrad_status tilegrad_backward(tilegrad_renderer* renderer,
                                                 const tilegrad_frame* frame,
                                                 const tilegrad_frame_gradients* d_frame,
                                                 const tilegrad_scene_gradients* d_scenes,
                                                 size_t count, int32_t add);

#ifdef __cplusplus
}
#endif

#endif /* TILEGRAD_C_H_ */
