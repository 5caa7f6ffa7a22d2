// Eight threads that push, predict, snapshot, clone, close and release the same handles, for sanitizers and valgrind. Every call returns a
// result, MEISSNER_BUSY or MEISSNER_CLOSED.
//
//     threads [SECONDS]
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "meissner.h"

#define ASSERT(condition)                                                                        \
  do {                                                                                           \
    if (!(condition)) {                                                                          \
      fprintf(stderr, "%s:%d: %s (%s)\n", __FILE__, __LINE__, #condition, meissner_error_text()); \
      exit(1);                                                                                   \
    }                                                                                            \
  } while (0)

enum { THREADS = 8, PLACES = 3, BLOCK = 64, WIDTH = 64, HEIGHT = 48, OUTPUTS = 3, ACTIONS = 20 };

// Handles that every thread uses. A handle that has ended is used until another one replaces it.
typedef struct {
  _Atomic(meissner_network *) network;
  _Atomic(meissner_engine *) engine;
  _Atomic(meissner_input *) input;
  _Atomic(meissner_live *) live;
} place;

static place places[PLACES];
static atomic_bool ended;
static atomic_ulong done[ACTIONS], busy, closed;

static bool count(int action, meissner_status status) {
  ASSERT(status == MEISSNER_OK || status == MEISSNER_BUSY || status == MEISSNER_CLOSED);
  atomic_fetch_add(status == MEISSNER_OK ? &done[action] : status == MEISSNER_BUSY ? &busy : &closed, 1);
  return status == MEISSNER_OK;
}

static bool new_engine(int action, place *at) {
  meissner_engine *made = NULL;
  const bool is = count(action, meissner_engine_new(at->network, WIDTH, HEIGHT, NULL, &made));
  if (is) meissner_engine_release(atomic_exchange(&at->engine, made));
  return is;
}

static void new_live(int action, place *at, uint32_t random) {
  meissner_input *input = NULL;
  meissner_live *live = NULL;
  const meissner_live_options options = {.size = sizeof options, .capacity = 256, .overload = random % 3};
  if (!count(action, meissner_live_new(at->engine, &options, &input, &live))) return;
  meissner_input_release(atomic_exchange(&at->input, input));
  meissner_live_release(atomic_exchange(&at->live, live));
}

static void new_network(int action, place *at) {
  meissner_network *made = NULL;
  const meissner_network_options small = {.size = sizeof small, .capacity = 300};
  if (count(action, meissner_network_open("tactip-past", NULL, &small, &made)))
    meissner_network_release(atomic_exchange(&at->network, made));
}

// Whether a snapshot was taken. The engine may have more events by the second call.
static bool snapshot(int action, meissner_engine *engine, uint8_t **bytes, size_t *length) {
  const meissner_status status = meissner_engine_snapshot(engine, *bytes, *length, length);
  if (status != MEISSNER_BUFFER_TOO_SMALL) return count(action, status);
  free(*bytes);
  *length += *length / 2;
  ASSERT((*bytes = malloc(*length)) != NULL);
  return false;
}

static void act(place *at, int action, uint32_t random, int64_t *t_us, uint8_t **bytes, size_t *room) {
  meissner_event events[BLOCK];
  for (int i = 0; i < BLOCK; i++) {
    *t_us += random % 97;
    events[i] = (meissner_event){.t_us = *t_us, .x = (uint16_t)(random + (uint32_t)i) % WIDTH, .y = (uint16_t)i % HEIGHT, .polarity = (int8_t)(i % 2)};
  }
  float values[OUTPUTS];
  meissner_counters counters = {.size = sizeof counters};
  meissner_queue_counters queue = {.size = sizeof queue};
  meissner_network_info info = {.size = sizeof info};
  meissner_engine *made = NULL;
  size_t length = *room;
  switch (action) {
    case 0: count(action, meissner_engine_push_events(at->engine, events, BLOCK, NULL)); break;
    case 1: count(action, meissner_engine_push(at->engine, *t_us, 3, 4, 1, NULL)); break;
    case 2:
    case 3: count(action, meissner_engine_predict(at->engine, values, OUTPUTS, NULL)); break;
    case 4:
      if (count(action, meissner_engine_counters(at->engine, &counters)))
        ASSERT(counters.pushed >= counters.accepted + counters.late && counters.outside_sensor == 0);
      break;
    case 5:
      if (snapshot(action, at->engine, bytes, &length)) count(action, meissner_engine_restore(at->engine, *bytes, length));
      if (length > *room) *room = length;
      break;
    case 6: count(action, meissner_engine_advance(at->engine, *t_us)); break;
    case 7: count(action, meissner_engine_reset(at->engine)); break;
    case 8:
      if (count(action, meissner_engine_clone(at->engine, &made))) meissner_engine_release(atomic_exchange(&at->engine, made));
      break;
    case 9: new_engine(action, at); break;
    case 10: meissner_engine_release(at->engine), new_engine(action, at); break;
    case 11:
    case 12: count(action, meissner_input_push_events(at->input, events, BLOCK)); break;
    case 13: count(action, meissner_input_advance(at->input, *t_us)); break;
    case 14: count(action, meissner_live_predict(at->live, random % 2 ? UINT64_MAX : random % 100000, values, OUTPUTS, NULL)); break;
    case 15:
      if (count(action, meissner_live_counters(at->live, &queue))) ASSERT(queue.delivered <= queue.offered);
      break;
    case 16:
      if (count(action, meissner_live_close(at->live, &made))) meissner_engine_release(atomic_exchange(&at->engine, made));
      new_live(action, at, random);
      break;
    case 17: meissner_live_release(at->live), new_live(action, at, random); break;
    case 18: meissner_input_release(at->input), new_live(action, at, random); break;
    default:
      count(action, meissner_network_describe(at->network, &info));
      if (random % 8 == 0) meissner_network_release(at->network), new_network(action, at);
  }
}

static void *run(void *argument) {
  uint32_t random = *(const uint32_t *)argument;
  int64_t t_us = 0;
  size_t room = 1;
  uint8_t *bytes = malloc(room);
  ASSERT(bytes != NULL);
  // Each 20 rounds do every action once. Each thread starts with a different action.
  for (int round = (int)(random % ACTIONS); !ended; round++) {
    random = random * 1664525u + 1013904223u;
    act(&places[(random >> 8) % PLACES], (int)((unsigned)round * 7 % ACTIONS), random >> 4, &t_us, &bytes, &room);
  }
  free(bytes);
  return NULL;
}

static bool each_was_done(void) {
  for (int i = 0; i < ACTIONS; i++)
    if (done[i] == 0) return false;
  return busy + closed > 0;
}

int main(int argc, char **argv) {
  const unsigned seconds = argc > 1 ? (unsigned)atoi(argv[1]) : 3;
  for (int i = 0; i < PLACES; i++) new_network(19, &places[i]), new_engine(9, &places[i]), new_live(17, &places[i], 0);
  pthread_t threads[THREADS];
  uint32_t seeds[THREADS];
  for (uint32_t i = 0; i < THREADS; i++) {
    seeds[i] = i * 7919;
    ASSERT(pthread_create(&threads[i], NULL, run, &seeds[i]) == 0);
  }
  sleep(seconds);
  // Under valgrind, threads take turns: waits up to two minutes more until each action has been done.
  for (int more = 0; more < 120 && !each_was_done(); more++) sleep(1);
  ended = true;
  for (int i = 0; i < THREADS; i++) pthread_join(threads[i], NULL);
  for (int i = 0; i < PLACES; i++) {
    meissner_live_release(places[i].live), meissner_input_release(places[i].input);
    meissner_engine_release(places[i].engine), meissner_network_release(places[i].network);
  }
  for (int i = 0; i < ACTIONS; i++) if (done[i] == 0) fprintf(stderr, "action %d was never done\n", i);
  ASSERT(each_was_done());
  unsigned long all = 0;
  for (int i = 0; i < ACTIONS; i++) all += done[i];
  printf("%d threads in %u s: %lu calls, %lu found the handle in use, %lu found it ended\n", THREADS, seconds, all, busy, closed);
  return 0;
}
