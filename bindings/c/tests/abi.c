// The interface from a C program, for sanitizers and valgrind: every function and its refusals.
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "meissner.h"

#define ASSERT(condition)                                                                       \
  do {                                                                                          \
    if (!(condition)) {                                                                         \
      fprintf(stderr, "%s:%d: %s (%s)\n", __FILE__, __LINE__, #condition, meissner_error_text()); \
      exit(1);                                                                                  \
    }                                                                                           \
  } while (0)
#define OK(call) ASSERT((call) == MEISSNER_OK)

enum { EVENTS = 3000 };

static meissner_event events[EVENTS];
static int64_t t_us[EVENTS];
static uint16_t x[EVENTS], y[EVENTS];
static int8_t polarity[EVENTS];

// A linear congruential generator: events in a moving square, some off the sensor, some late.
static void make_events(void) {
  uint32_t state = 7;
  for (int i = 0; i < EVENTS; i++) {
    state = state * 1103515245u + 12345u;
    t_us[i] = i * 60 - (state >> 28 == 0 ? 2000 : 0);
    x[i] = (uint16_t)(20 + i / 40 + (int)(state >> 8) % 30);
    y[i] = (uint16_t)(10 + (int)(state >> 16) % 60);
    polarity[i] = state >> 24 & 1 ? 1 : (int8_t)-(state >> 25 & 1);
    events[i] = (meissner_event){.t_us = t_us[i], .x = x[i], .y = y[i], .polarity = polarity[i]};
  }
}

static int warnings, losses;

static void count(const char *text, void *user) {
  ASSERT(text[0] != 0 && user == &warnings);
  if (strstr(text, "events are dropped")) losses++;
  else warnings++;
}

static void same_from_every_way_in(meissner_network *network) {
  meissner_engine *one = NULL, *many = NULL, *arrays = NULL, *copied = NULL;
  OK(meissner_engine_new(network, 120, 80, NULL, &one));
  OK(meissner_engine_new(network, 120, 80, NULL, &many));
  OK(meissner_engine_new(network, 120, 80, NULL, &arrays));
  size_t accepted = 0, from_arrays = 0, sum = 0;
  for (int i = 0; i < EVENTS; i++) {
    bool entered = false;
    OK(meissner_engine_push(one, t_us[i], x[i], y[i], polarity[i], &entered));
    sum += entered;
  }
  OK(meissner_engine_push_events(many, events, EVENTS, &accepted));
  OK(meissner_engine_push_arrays(arrays, t_us, x, y, polarity, EVENTS, &from_arrays));
  ASSERT(sum == accepted && accepted == from_arrays && accepted > 2000 && accepted < EVENTS);
  OK(meissner_engine_clone(many, &copied));

  float values[4][2];
  meissner_engine *all[4] = {one, many, arrays, copied};
  for (int i = 0; i < 4; i++) {
    OK(meissner_engine_advance(all[i], EVENTS * 60 + 100));
    meissner_prediction prediction = {.size = sizeof prediction};
    OK(meissner_engine_predict(all[i], values[i], 2, &prediction));
    ASSERT(prediction.has_time == 1 && prediction.nodes > 1000 && prediction.size == sizeof prediction);
    ASSERT(memcmp(values[i], values[0], sizeof values[0]) == 0 && isfinite(values[i][0]));
    ASSERT(prediction.unlike > 1.0f); // random events are no press
  }

  meissner_counters counters = {.size = sizeof counters};
  OK(meissner_engine_counters(many, &counters));
  ASSERT(counters.pushed == EVENTS && counters.accepted == accepted && counters.predictions == 1);
  ASSERT(counters.pushed == counters.accepted + counters.outside_sensor + counters.late + counters.time_out_of_range);
  // A program that was built when the struct was shorter.
  struct {
    size_t size;
    uint64_t pushed, guard;
  } older = {.size = 16, .pushed = 0, .guard = 99};
  OK(meissner_engine_counters(many, (meissner_counters *)&older));
  ASSERT(older.pushed == EVENTS && older.guard == 99);

  size_t length = 0;
  ASSERT(meissner_engine_snapshot(many, NULL, 0, &length) == MEISSNER_BUFFER_TOO_SMALL && length > 1000);
  uint8_t *bytes = malloc(length);
  OK(meissner_engine_snapshot(many, bytes, length, &length));
  OK(meissner_engine_reset(one));
  OK(meissner_engine_restore(one, bytes, length));
  OK(meissner_engine_predict(one, values[0], 2, NULL));
  ASSERT(memcmp(values[0], values[1], sizeof values[0]) == 0);
  bytes[length / 2] ^= 1;
  ASSERT(meissner_engine_restore(one, bytes, length) == MEISSNER_INVALID_SNAPSHOT);
  ASSERT(meissner_engine_restore(one, bytes, 3) == MEISSNER_INVALID_SNAPSHOT);
  OK(meissner_engine_predict(one, values[0], 2, NULL));
  ASSERT(memcmp(values[0], values[1], sizeof values[0]) == 0);
  free(bytes);

  char text[1024];
  ASSERT(meissner_engine_warnings(many, NULL, 0, &length) == MEISSNER_BUFFER_TOO_SMALL && length < sizeof text);
  OK(meissner_engine_warnings(many, text, sizeof text, &length));
  ASSERT(length == strlen(text) + 1 && strstr(text, "sensor of 346x260, not 120x80\n"));
  ASSERT(strstr(text, "of 3000 events are dropped, earlier than one before"));
  OK(meissner_network_warnings(network, text, sizeof text, &length));
  ASSERT(length == 1 && text[0] == 0);

  meissner_network_info info = {.size = sizeof info};
  OK(meissner_network_describe(network, &info));
  meissner_layer_counters *layers = calloc(info.layers, sizeof *layers);
  OK(meissner_engine_layer_counters(many, layers, info.layers));
  ASSERT(layers[0].computed == accepted);
  ASSERT(meissner_engine_layer_counters(many, layers, info.layers - 1) == MEISSNER_BUFFER_TOO_SMALL);
  free(layers);
  for (int i = 0; i < 4; i++) meissner_engine_release(all[i]);
}

static void frames(void) {
  meissner_network *network = NULL;
  meissner_frames *engine = NULL, *other = NULL;
  OK(meissner_network_open("force-lstm", NULL, NULL, &network));
  meissner_network_info info = {.size = sizeof info};
  OK(meissner_network_describe(network, &info));
  ASSERT(info.kind == MEISSNER_FRAMES && info.trained == 1 && strcmp(info.name, "force-lstm") == 0);
  const size_t values = (size_t)info.input_channels * info.input_height * info.input_width;
  float *frame = calloc(values, sizeof *frame), *found = calloc(2 * info.outputs, sizeof *found);
  frame[values / 2] = 0.5f;
  const meissner_frames_options sparse = {.size = sizeof sparse, .sparse = 1};
  OK(meissner_frames_new(network, &sparse, &engine));
  OK(meissner_frames_new(network, NULL, &other));
  OK(meissner_frames_push(engine, frame, values));
  OK(meissner_frames_push(other, frame, values));
  meissner_prediction prediction = {.size = sizeof prediction};
  OK(meissner_frames_predict(engine, found, info.outputs, &prediction));
  OK(meissner_frames_predict(other, found + info.outputs, info.outputs, NULL));
  ASSERT(prediction.unlike > 0.0f); // the weights say what frames were like
  ASSERT(prediction.nodes == 1 && memcmp(found, found + info.outputs, info.outputs * sizeof *found) == 0);
  ASSERT(meissner_frames_push(engine, frame, values - 1) == MEISSNER_INVALID_ARGUMENT);
  frame[0] = NAN;
  ASSERT(meissner_frames_push(engine, frame, values) == MEISSNER_INVALID_ARGUMENT);
  size_t length = 0;
  ASSERT(meissner_frames_snapshot(engine, NULL, 0, &length) == MEISSNER_BUFFER_TOO_SMALL);
  uint8_t *bytes = malloc(length);
  OK(meissner_frames_snapshot(engine, bytes, length, &length));
  OK(meissner_frames_reset(engine));
  OK(meissner_frames_restore(engine, bytes, length));
  OK(meissner_frames_predict(engine, found, info.outputs, NULL));
  ASSERT(memcmp(found, found + info.outputs, info.outputs * sizeof *found) == 0);
  meissner_layer_counters *layers = calloc(info.layers, sizeof *layers);
  OK(meissner_frames_layer_counters(engine, layers, info.layers));
  meissner_engine *wrong = NULL;
  ASSERT(meissner_engine_new(network, 10, 10, NULL, &wrong) == MEISSNER_WRONG_NETWORK && wrong == NULL);
  free(layers), free(bytes), free(frame), free(found);
  meissner_frames_release(engine);
  meissner_frames_release(other);
  meissner_network_release(network);
}

static void *push(void *input) {
  for (int i = 0; i < EVENTS; i += 100) {
    if (meissner_input_push_events(input, events + i, 50) != MEISSNER_OK) return input;
    if (meissner_input_push_arrays(input, t_us + i + 50, x + i + 50, y + i + 50, polarity + i + 50, 50) != MEISSNER_OK)
      return input;
  }
  return meissner_input_advance(input, EVENTS * 60) == MEISSNER_OK ? NULL : input;
}

// A forked child has none of the threads: calls that need them return MEISSNER_FORKED and do not wait. Handles that the child makes work.
static void forked(meissner_network *network, meissner_engine *engine, meissner_live *live, meissner_input *input) {
  meissner_network *of_frames = NULL;
  meissner_frames *frames = NULL;
  const meissner_frames_options two = {.size = sizeof two, .two_threads = 1};
  OK(meissner_network_open("event-frame-cnn", NULL, NULL, &of_frames));
  OK(meissner_frames_new(of_frames, &two, &frames));
  meissner_network_info info = {.size = sizeof info};
  OK(meissner_network_describe(of_frames, &info));
  const size_t length = (size_t)info.input_channels * info.input_height * info.input_width;
  float *frame = calloc(length, sizeof *frame);
  frame[length / 2] = 1;
  OK(meissner_frames_push(frames, frame, length));
  const pid_t child = fork();
  ASSERT(child >= 0);
  if (child == 0) {
    float values[2];
    meissner_engine *back = NULL;
    ASSERT(meissner_live_predict(live, UINT64_MAX, values, 2, NULL) == MEISSNER_FORKED);
    ASSERT(strstr(meissner_error_text(), "fork") != NULL);
    ASSERT(meissner_input_push_events(input, events, 1) == MEISSNER_FORKED);
    ASSERT(meissner_live_close(live, &back) == MEISSNER_FORKED && back == NULL);
    meissner_live_release(live), meissner_input_release(input);
    ASSERT(meissner_live_predict(live, UINT64_MAX, values, 2, NULL) == MEISSNER_CLOSED);
    ASSERT(meissner_frames_push(frames, frame, length) == MEISSNER_FORKED);
    meissner_frames_release(frames);
    OK(meissner_engine_push_events(engine, events, EVENTS, NULL));
    OK(meissner_live_new(engine, NULL, &input, &live));
    OK(meissner_live_predict(live, UINT64_MAX, values, 2, NULL));
    OK(meissner_live_close(live, &back));
    meissner_engine_release(back), meissner_input_release(input);
    OK(meissner_engine_new(network, 120, 80, NULL, &back));
    // Valgrind would report the memory that the parent's threads hold as lost.
    execlp("true", "true", (char *)NULL);
    _exit(1);
  }
  int status = 0;
  ASSERT(waitpid(child, &status, 0) == child && status == 0);
  OK(meissner_frames_push(frames, frame, length));
  free(frame);
  meissner_frames_release(frames), meissner_network_release(of_frames);
}

static void live(meissner_network *network) {
  meissner_engine *engine = NULL, *back = NULL;
  meissner_input *input = NULL;
  meissner_live *live = NULL;
  OK(meissner_engine_new(network, 120, 80, NULL, &engine));
  const meissner_live_options block = {.size = sizeof block, .capacity = 128, .overload = MEISSNER_OVERLOAD_BLOCK, .ahead = 1};
  OK(meissner_live_new(engine, &block, &input, &live));
  pthread_t sensor;
  ASSERT(pthread_create(&sensor, NULL, push, input) == 0);
  float values[2], expected[2];
  meissner_timely timely = {.size = sizeof timely};
  OK(meissner_live_predict(live, 1000000, values, 2, &timely));
  void *failed = input;
  ASSERT(pthread_join(sensor, &failed) == 0 && failed == NULL);
  OK(meissner_live_predict(live, UINT64_MAX, values, 2, &timely));
  // Lost late events make the first prediction stale. Nothing is lost after it.
  ASSERT(timely.fresh == 0 && timely.behind_events == 0);
  OK(meissner_live_predict(live, UINT64_MAX, values, 2, &timely));
  ASSERT(timely.fresh == 1 && timely.behind_events == 0);
  meissner_queue_counters counters = {.size = sizeof counters};
  OK(meissner_live_counters(live, &counters));
  ASSERT(counters.offered == EVENTS && counters.delivered == EVENTS && counters.high_water <= 128);
  OK(meissner_engine_push_events(engine, events, EVENTS, NULL));
  OK(meissner_engine_advance(engine, EVENTS * 60));
  OK(meissner_engine_predict(engine, expected, 2, NULL));
  ASSERT(memcmp(values, expected, sizeof values) == 0);
  OK(meissner_live_close(live, &back));
  ASSERT(meissner_input_push_events(input, events, 1) == MEISSNER_CLOSED);
  OK(meissner_engine_predict(back, values, 2, NULL));
  ASSERT(memcmp(values, expected, sizeof values) == 0);
  meissner_engine_release(back);
  meissner_input_release(input);
  ASSERT(meissner_live_close(live, &back) == MEISSNER_CLOSED);
  OK(meissner_live_new(engine, NULL, &input, &live));
  forked(network, engine, live, input);
  OK(meissner_live_predict(live, UINT64_MAX, values, 2, &timely));
  meissner_live_release(live);
  meissner_input_release(input);
  meissner_engine_release(engine);
}

static void refusals(meissner_network *network) {
  meissner_network *none = NULL;
  ASSERT(meissner_network_open(NULL, NULL, NULL, &none) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_network_open("no-such", NULL, NULL, &none) == MEISSNER_NOT_FOUND);
  ASSERT(strstr(meissner_error_text(), "no-such") != NULL);
  ASSERT(meissner_network_open("tactigraph-past", "no-such-file", NULL, &none) == MEISSNER_NOT_FOUND);
  ASSERT(meissner_network_open("tactigraph-past", NULL, NULL, NULL) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_network_from_bytes("[network]", 9, NULL, 0, NULL, &none) == MEISSNER_INVALID_NETWORK);
  meissner_network_options options = {.size = sizeof options + 8};
  ASSERT(meissner_network_open("tactigraph-past", NULL, &options, &none) == MEISSNER_INVALID_ARGUMENT);
  options = (meissner_network_options){.size = 0};
  ASSERT(meissner_network_open("tactigraph-past", NULL, &options, &none) == MEISSNER_INVALID_ARGUMENT);
  options = (meissner_network_options){.size = sizeof options, .ignore_preparation = 7};
  ASSERT(meissner_network_open("tactigraph-past", NULL, &options, &none) == MEISSNER_INVALID_ARGUMENT);
  options = (meissner_network_options){.size = sizeof options, .span_us = -1};
  ASSERT(meissner_network_open("tactigraph-past", NULL, &options, &none) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(none == NULL);

  meissner_engine *engine = NULL;
  ASSERT(meissner_engine_new(network, 0, 80, NULL, &engine) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_engine_new(NULL, 120, 80, NULL, &engine) == MEISSNER_INVALID_ARGUMENT);
  meissner_engine_options small = {.size = sizeof small, .memory_limit = 1};
  ASSERT(meissner_engine_new(network, 120, 80, &small, &engine) == MEISSNER_MEMORY_LIMIT);
  small = (meissner_engine_options){.size = sizeof small, .late = 2};
  ASSERT(meissner_engine_new(network, 120, 80, &small, &engine) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(engine == NULL);
  OK(meissner_engine_new(network, 120, 80, NULL, &engine));
  float values[2];
  ASSERT(meissner_engine_predict(engine, values, 1, NULL) == MEISSNER_BUFFER_TOO_SMALL);
  ASSERT(meissner_engine_predict(engine, NULL, 2, NULL) == MEISSNER_INVALID_ARGUMENT);
  meissner_prediction unsized_ = {.size = 0};
  ASSERT(meissner_engine_predict(engine, values, 2, &unsized_) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_engine_push_events(engine, NULL, 1, NULL) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_engine_push_events(engine, (meissner_event *)((char *)events + 1), 1, NULL) == MEISSNER_INVALID_ARGUMENT);
  ASSERT(meissner_engine_push_events(engine, events, SIZE_MAX, NULL) == MEISSNER_INVALID_ARGUMENT);
  OK(meissner_engine_push_events(engine, NULL, 0, NULL));
  ASSERT(meissner_engine_advance(NULL, 0) == MEISSNER_INVALID_ARGUMENT);
  const char *name = NULL;
  ASSERT(meissner_network_output(network, 2, &name, NULL) == MEISSNER_INVALID_ARGUMENT && name == NULL);
  OK(meissner_network_output(network, 1, &name, NULL));
  ASSERT(strcmp(name, "pitch") == 0);
  meissner_engine_release(engine);

  meissner_engine_release(NULL), meissner_network_release(NULL), meissner_frames_release(NULL);
  meissner_live_release(NULL), meissner_input_release(NULL);
}

int main(void) {
  make_events();
  ASSERT(meissner_version() >= 0x000100 && meissner_version_text()[0] != 0);
  ASSERT(meissner_has_feature("live") && meissner_has_feature("portable") && !meissner_has_feature("fax"));
  ASSERT(!meissner_has_feature(NULL) && meissner_error_text()[0] == 0);
  size_t shipped = 0;
  while (meissner_shipped_network(shipped) != NULL) shipped++;
  ASSERT(shipped > 20);

  meissner_set_log(count, &warnings);
  meissner_network *network = NULL;
  OK(meissner_network_open("tactigraph-past", NULL, NULL, &network));
  ASSERT(warnings == 0);
  refusals(network);
  warnings = 0;
  same_from_every_way_in(network);
  ASSERT(warnings == 3 && losses >= 3);
  live(network);
  warnings = 0;
  frames();
  ASSERT(warnings == 0);
  meissner_set_log(NULL, NULL);
  meissner_network_release(network);
  puts("the C interface holds");
  return 0;
}
