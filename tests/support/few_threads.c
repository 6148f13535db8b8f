/* SPDX-License-Identifier: Apache-2.0 */
/* A system that grants as many threads to each process as TILEGRAD_TEST_THREADS says, at one time:
 * linked into a test, or preloaded. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

static atomic_int running;

typedef struct {
  void* (*run)(void*);
  void* argument;
} start;

static void* counted(void* data) {
  const start call = *(start*)data;
  free(data);
  void* const result = call.run(call.argument);
  atomic_fetch_sub(&running, 1);
  return result;
}

__attribute__((visibility("default"))) int pthread_create(pthread_t* thread,
                                                          const pthread_attr_t* attributes,
                                                          void* (*run)(void*), void* argument) {
  int (*create)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  *(void**)&create = dlsym(RTLD_NEXT, "pthread_create");
  const char* const most = getenv("TILEGRAD_TEST_THREADS");
  if (most == NULL) return create(thread, attributes, run, argument);
  if (atomic_fetch_add(&running, 1) >= atoi(most)) {
    atomic_fetch_sub(&running, 1);
    return EAGAIN;
  }
  start* const call = malloc(sizeof *call);
  call->run = run;
  call->argument = argument;
  const int error = create(thread, attributes, counted, call);
  if (error != 0) {
    free(call);
    atomic_fetch_sub(&running, 1);
  }
  return error;
}
