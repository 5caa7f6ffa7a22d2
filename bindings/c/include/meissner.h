// Meissner from C: incremental inference for event cameras and event-based touch.
//
// cbindgen generates this file from bindings/c/src: make changes there. bindings/c/README.md has examples.
//
// Calls. A function that can fail returns a `meissner_status`; `meissner_error_text` says what was expected and what was found. A call
// that fails leaves its handles unchanged, and writes only what its comment states. Nothing unwinds into the caller.
//
// Handles. One function makes a handle, and the function whose name ends in `_release` ends it; that function ignores NULL. A handle may
// move between threads. Many threads may use a network at once, and it may be released while its engines run. Only one thread at a time
// uses any other handle: a call that finds it in use on another thread changes nothing and returns MEISSNER_BUSY.
//
// Ends of handles. A release waits for the call of another thread that uses the handle, and lets no other call begin; a close does not
// wait and returns MEISSNER_BUSY. A call with a handle that has ended returns MEISSNER_CLOSED, however late it comes, and a release of
// such a handle changes nothing. A handle is a number, not an address: it must not be dereferenced. Memory that the calls of a handle
// return, such as the strings of a network, is valid until the handle ends.
//
// Structs. All structs except those in arrays begin with `size`, which the caller sets to the struct's `sizeof`: programs keep working
// with later versions, whose structs may be longer. In options, 0 selects the default.
//
// Memory. Pushes, advances and predictions allocate nothing after an engine over events is made. Functions that allocate say so.


#ifndef MEISSNER_H
#define MEISSNER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>


// Events that are earlier than the newest are dropped and counted.
#define MEISSNER_LATE_DROP 0

// Events that are earlier than the newest enter with its time, and are counted.
#define MEISSNER_LATE_CLAMP 1

// When the clock of the sensor restarts, the engine resets and takes the events of the new clock.
// Events that are earlier than the window, or more than 10 s ahead, are held until later events
// show whether the clock has restarted or a single time is wrong.
#define MEISSNER_RESTART_RESET 0

// The clock never goes back: events are late until the old time is reached again.
#define MEISSNER_RESTART_KEEP 1

// Values that no change reaches are kept: exact.
#define MEISSNER_SKIP_EXACT 0

// Everything is computed: the same results, as an oracle.
#define MEISSNER_SKIP_NOTHING 1

// Pixels that changed by no more than `tolerance` count as unchanged: an approximation.
#define MEISSNER_SKIP_TOLERANCE 2

// When the queue is full, the oldest waiting event is dropped.
#define MEISSNER_OVERLOAD_DROP_OLDEST 0

// When the queue is full, the thread that pushes waits: nothing is dropped.
#define MEISSNER_OVERLOAD_BLOCK 1

// When the queue is full, new events are dropped.
#define MEISSNER_OVERLOAD_DROP_NEWEST 2

// From half full until a quarter full, the queue takes one of every `stride` events.
#define MEISSNER_OVERLOAD_THIN 3

// Convolutions of frame networks: exact sums.
#define MEISSNER_CONVOLUTION_DIRECT 0

// Winograd's method in tiles of 2 x 2 outputs: fewer products, with other rounding errors.
#define MEISSNER_CONVOLUTION_WINOGRAD_2 1

// Winograd's method in tiles of 4 x 4 outputs: still fewer products, and larger rounding errors.
#define MEISSNER_CONVOLUTION_WINOGRAD_4 2

// A network over events.
#define MEISSNER_EVENTS 1

// A frame network.
#define MEISSNER_FRAMES 2

// Result of a call.
typedef enum meissner_status {
  // It succeeded.
  MEISSNER_OK = 0,
  // An argument is out of range, or a pointer is NULL or misaligned.
  MEISSNER_INVALID_ARGUMENT = 1,
  // There is no network of this name, or a file cannot be read.
  MEISSNER_NOT_FOUND = 2,
  // A description is inconsistent, or weights do not fit it.
  MEISSNER_INVALID_NETWORK = 3,
  // The network is of another kind than the function takes, or has no incremental form.
  MEISSNER_WRONG_NETWORK = 4,
  // The memory of the caller is too small for the result.
  MEISSNER_BUFFER_TOO_SMALL = 5,
  // The engine would need more memory than its limit.
  MEISSNER_MEMORY_LIMIT = 6,
  // A layer computed NaN: there is no prediction. The engine predicts again once the cause has
  // left the window.
  MEISSNER_NOT_A_NUMBER = 7,
  // Bytes are not a snapshot of such an engine.
  MEISSNER_INVALID_SNAPSHOT = 8,
  // Another thread is using the handle.
  MEISSNER_BUSY = 9,
  // The live engine has ended, or the handle was closed or released.
  MEISSNER_CLOSED = 10,
  // A fault in the library. The handle can only be released.
  MEISSNER_PANICKED = 11,
  // The call needs threads of the process that forked this one: make the handle in the child,
  // after the fork.
  MEISSNER_FORKED = 12,
} meissner_status;

// A network over the events of a sliding window. One thread at a time.
typedef struct meissner_engine meissner_engine;

// A network over frames, with its state. One thread at a time.
typedef struct meissner_frames meissner_frames;

// The sensor's side of a live engine. One thread at a time.
typedef struct meissner_input meissner_input;

// The controller's side of a live engine. One thread at a time.
typedef struct meissner_live meissner_live;

// A network with its weights. It does not change, and any number of threads and engines may use
// it.
typedef struct meissner_network meissner_network;

// Options of an engine over events. 0 is the default of each.
typedef struct meissner_engine_options {
  // `sizeof(meissner_engine_options)`.
  size_t size;
  // Limit of the state in bytes; 0 for 4 GiB.
  uint64_t memory_limit;
  // Largest change of a row that does not propagate, in the units of the layer: an
  // approximation. 0 is exact.
  float tolerance;
  // MEISSNER_LATE_DROP or MEISSNER_LATE_CLAMP.
  uint32_t late;
  // MEISSNER_RESTART_RESET or MEISSNER_RESTART_KEEP.
  uint64_t restart;
} meissner_engine_options;

// A change of brightness at a pixel.
typedef struct meissner_event {
  // Time in microseconds, on any epoch: only differences count.
  int64_t t_us;
  // Column, from the left.
  uint16_t x;
  // Row, from the top.
  uint16_t y;
  // More than 0 if the brightness rose; 0 or less if it fell.
  int8_t polarity;
} meissner_event;

// Facts about a prediction.
typedef struct meissner_prediction {
  // `sizeof(meissner_prediction)`, set by the caller.
  size_t size;
  // Time of the newest event or frame that it covers; 0 before the first.
  int64_t t_us;
  // 1 if an event or a frame has set the time.
  uint32_t has_time;
  // Events in the window; for a frame engine, frames since the last reset.
  uint64_t nodes;
  // Rows that were computed since the previous prediction, over all layers.
  uint64_t rows;
  // How much the window or the newest frames differ from those of the training. Fewer than 1 in
  // 1,000 of the training's were above 1. NaN if the weights do not say what the training's were
  // like.
  float unlike;
} meissner_prediction;

// Counts of events since the engine was made. `pushed` is the sum of `accepted` and of the counts
// of the five reasons for which events are dropped.
typedef struct meissner_counters {
  // `sizeof(meissner_counters)`, set by the caller.
  size_t size;
  // Events pushed, without those that are held.
  uint64_t pushed;
  // Events that entered the window.
  uint64_t accepted;
  // Dropped: not on the sensor.
  uint64_t outside_sensor;
  // Dropped: earlier than the newest.
  uint64_t late;
  // Dropped: too far from the first event for 64 bits.
  uint64_t time_out_of_range;
  // Late events that entered with the newest time.
  uint64_t clamped;
  // Events that left because they were older than the window.
  uint64_t expired;
  // Events that left earlier because the window was full.
  uint64_t evicted;
  // Predictions read; 0 for a live engine.
  uint64_t predictions;
  // Of these, predictions for which nothing had changed.
  uint64_t reused;
  // Dropped: a single time far ahead.
  uint64_t outliers;
  // Restarts of the sensor's clock, each of which reset the engine.
  uint64_t restarts;
  // Dropped: by a filter that the network states, such as one for pixels that fire all the time.
  uint64_t filtered;
} meissner_counters;

// Counts of rows of a layer, or of its pixels in a frame network, since the engine was made.
typedef struct meissner_layer_counters {
  // Computed.
  uint64_t computed;
  // Kept, because nothing that they depend on had changed.
  uint64_t kept;
  // Computed, with the same bits as before.
  uint64_t unchanged;
} meissner_layer_counters;

// Options of a frame engine. 0 is the default of each.
typedef struct meissner_frames_options {
  // `sizeof(meissner_frames_options)`.
  size_t size;
  // Limit of the state in bytes; 0 for 4 GiB.
  uint64_t memory_limit;
  // MEISSNER_SKIP_EXACT or another MEISSNER_SKIP constant.
  uint32_t skip;
  // Used with MEISSNER_SKIP_TOLERANCE.
  float tolerance;
  // 1 if frames are mostly zero, as frames of events are: the same results with more memory and
  // less time.
  uint32_t sparse;
  // 1 to share large layers between two threads: the same results.
  uint32_t two_threads;
} meissner_frames_options;

// Options of a live engine. 0 is the default of each.
typedef struct meissner_live_options {
  // `sizeof(meissner_live_options)`.
  size_t size;
  // Maximum number of waiting events, of 16 bytes each; 0 for 65,536.
  uint64_t capacity;
  // Maximum number of events that the engine takes before it checks whether a prediction is due;
  // 0 for 64.
  uint64_t batch;
  // MEISSNER_OVERLOAD_DROP_OLDEST or another MEISSNER_OVERLOAD constant.
  uint32_t overload;
  // Used with MEISSNER_OVERLOAD_THIN; at least 1.
  uint32_t stride;
  // 1 if the engine computes while no event waits and no prediction is requested: answers come
  // sooner, and more is computed in total.
  uint64_t ahead;
} meissner_live_options;

// Facts about a live prediction, and its age.
typedef struct meissner_timely {
  // `sizeof(meissner_timely)`, set by the caller.
  size_t size;
  // Time of the newest event that it covers; 0 before the first.
  int64_t t_us;
  // Events in the window.
  uint64_t nodes;
  // Events that had been pushed at the time of the call and are not covered.
  uint64_t behind_events;
  // Stream time in microseconds from the last covered event to the last one that had been
  // pushed.
  uint64_t behind_us;
  // Nanoseconds since its computation began.
  uint64_t age_ns;
  // Nanoseconds since the call.
  uint64_t waited_ns;
  // 1 if an event has set `t_us`.
  uint32_t has_time;
  // 1 if it covers every event that had been pushed, except those that the queue dropped: no
  // event waits, and the engine has lost none.
  uint32_t fresh;
  // 1 if it was computed for this call, 0 if it is the newest prediction that was finished by
  // the deadline.
  uint32_t own;
  // Events since the previous prediction that the engine received and that this one does not
  // cover: late, outside the sensor, far ahead, or held until it is clear whether the sensor's
  // clock has restarted.
  uint64_t lost_events;
  // Events that the queue dropped since the previous prediction.
  uint64_t dropped_events;
  // Restarts of the sensor's clock since the previous prediction, each of which reset the
  // engine.
  uint64_t restarts;
  // How much the window differs from those of the training, as in `meissner_prediction`.
  float unlike;
} meissner_timely;

// Counts of pushed events. `offered` is the sum of `delivered`, `waiting` and the dropped ones.
typedef struct meissner_queue_counters {
  // `sizeof(meissner_queue_counters)`, set by the caller.
  size_t size;
  // Events pushed.
  uint64_t offered;
  // Events that the engine took.
  uint64_t delivered;
  // Events that are waiting.
  uint64_t waiting;
  // Dropped to make room for a newer one.
  uint64_t dropped_oldest;
  // Dropped for lack of room.
  uint64_t dropped_newest;
  // Dropped by thinning.
  uint64_t thinned;
  // Maximum number of events that have waited at the same time.
  uint64_t high_water;
  // Nanoseconds for which the thread that pushes has waited for room.
  uint64_t blocked_ns;
} meissner_queue_counters;

// Takes a warning, in UTF-8 and valid during the call, and the pointer that was given with the
// function. Any thread that makes a network or an engine, or pushes events, may call it; one at a
// time.
typedef void (*meissner_log)(const char *text, void *user);

// Options of a network. 0 is the default of each.
typedef struct meissner_network_options {
  // `sizeof(meissner_network_options)`.
  size_t size;
  // Length of the window in microseconds, instead of the description's. Networks over events
  // only.
  int64_t span_us;
  // Maximum number of events in the window, instead of the description's. Networks over events
  // only.
  uint64_t capacity;
  // Maximum number of neighbours of an event, at most the description's: an approximation.
  // Networks over events only.
  uint64_t neighbours;
  // MEISSNER_CONVOLUTION_DIRECT or another MEISSNER_CONVOLUTION constant. Frame networks only.
  uint32_t convolution;
  // 1 to take weights that were trained on other graphs or frames than the description's.
  uint32_t ignore_preparation;
} meissner_network_options;

// Facts about a network. The name belongs to the network.
typedef struct meissner_network_info {
  // `sizeof(meissner_network_info)`, set by the caller.
  size_t size;
  // Name of the description.
  const char *name;
  // MEISSNER_EVENTS or MEISSNER_FRAMES.
  uint32_t kind;
  // 1 if the weights were trained, 0 if they were drawn from a seed, -1 if they do not say.
  int32_t trained;
  // Number of values of a prediction.
  uint64_t outputs;
  // Length of the window in microseconds; 0 for frame networks.
  int64_t span_us;
  // Maximum number of events in the window; 0 for frame networks.
  uint64_t capacity;
  // Number of layers that are counted.
  uint64_t layers;
  // The weights were trained on every `stride`-th event: push the same share. At least 1.
  uint64_t stride;
  // Columns of the training's sensor; 0 if the weights do not say.
  uint16_t sensor_width;
  // Rows of the training's sensor; 0 if the weights do not say.
  uint16_t sensor_height;
  // Shape of a frame, for frame networks; a vector has a height and width of 1.
  uint32_t input_channels;
  // Rows of a frame.
  uint32_t input_height;
  // Columns of a frame.
  uint32_t input_width;
  // Shape of a prediction, for frame networks.
  uint32_t output_channels;
  // Rows of a prediction.
  uint32_t output_height;
  // Columns of a prediction.
  uint32_t output_width;
} meissner_network_info;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library: 65536 times the major, 256 times the minor and the patch number.
uint32_t meissner_version(void);

// The version as text, for example "0.2.0". The pointer stays valid.
const char *meissner_version_text(void);

// Whether this library and this processor have a feature: "events", "frames" and "live" name parts
// of the interface, other names instruction sets ("portable", "avx2", "avx512").
bool meissner_has_feature(const char *name);

// Makes an engine for a network over events and a sensor of `width` x `height` pixels. `options`
// may be NULL. Allocates: the whole state is made here.
enum meissner_status meissner_engine_new(const struct meissner_network *network,
                                         uint16_t width,
                                         uint16_t height,
                                         const struct meissner_engine_options *options,
                                         struct meissner_engine **result);

// Makes an engine in the state of another. Allocates.
enum meissner_status meissner_engine_clone(const struct meissner_engine *engine,
                                           struct meissner_engine **result);

// Pushes an event. `accepted`, which may be NULL, is set to whether the event entered the window;
// a dropped event is counted. An event whose time does not agree with the clock is held. It has
// not entered yet: it enters, or is counted as dropped, with a later event.
enum meissner_status meissner_engine_push(const struct meissner_engine *engine,
                                          int64_t t_us,
                                          uint16_t x,
                                          uint16_t y,
                                          int8_t polarity,
                                          bool *accepted);

// Pushes `length` events in order. `accepted`, which may be NULL, is set to the number of events
// that entered the window. It can be more than `length`, because it includes events that were held
// before.
enum meissner_status meissner_engine_push_events(const struct meissner_engine *engine,
                                                 const struct meissner_event *events,
                                                 size_t length,
                                                 size_t *accepted);

// Pushes `length` events in order. Their times in microseconds, columns, rows and polarities are
// in separate arrays. `accepted`, which may be NULL, is set to the number of events that entered
// the window.
enum meissner_status meissner_engine_push_arrays(const struct meissner_engine *engine,
                                                 const int64_t *t_us,
                                                 const uint16_t *x,
                                                 const uint16_t *y,
                                                 const int8_t *polarity,
                                                 size_t length,
                                                 size_t *accepted);

// Advances the clock to `t_us` without an event: events older than the window leave. Earlier times
// change nothing.
enum meissner_status meissner_engine_advance(const struct meissner_engine *engine, int64_t t_us);

// Predicts for the current window: writes the network's outputs to `values`, which has room for
// `length` values, and facts about the prediction to `prediction`, which may be NULL. Nothing is
// computed if `length` is less than the number of outputs.
enum meissner_status meissner_engine_predict(const struct meissner_engine *engine,
                                             float *values,
                                             size_t length,
                                             struct meissner_prediction *prediction);

// Removes all events; the next one may have any time. Counters stay.
enum meissner_status meissner_engine_reset(const struct meissner_engine *engine);

// Counts of events and predictions. Allocates temporary memory.
enum meissner_status meissner_engine_counters(const struct meissner_engine *engine,
                                              struct meissner_counters *counters);

// Counts of rows for each layer; `meissner_network_info` has the number of layers. Allocates
// temporary memory.
enum meissner_status meissner_engine_layer_counters(const struct meissner_engine *engine,
                                                    struct meissner_layer_counters *layers,
                                                    size_t length);

// Writes the warnings about an engine, as `meissner_network_warnings` does: about its network, a
// sensor that is not the training's, each reason for which more than one of a hundred events has
// been dropped, and restarts of the sensor's clock.
enum meissner_status meissner_engine_warnings(const struct meissner_engine *engine,
                                              char *text,
                                              size_t capacity,
                                              size_t *length);

// Writes the state as bytes to `bytes`, which has room for `capacity` bytes, and their number to
// `length`. If there is too little room, only `length` is written: call with a `capacity` of 0 to
// get it. Allocates.
enum meissner_status meissner_engine_snapshot(const struct meissner_engine *engine,
                                              uint8_t *bytes,
                                              size_t capacity,
                                              size_t *length);

// Sets the engine to the state of a snapshot of an engine with the same network, sensor and
// options. Allocates.
enum meissner_status meissner_engine_restore(const struct meissner_engine *engine,
                                             const uint8_t *bytes,
                                             size_t length);

// Ends an engine. Waits for the call of another thread that is using it.
void meissner_engine_release(struct meissner_engine *engine);

// Makes an engine for a frame network. `options` may be NULL. Allocates.
enum meissner_status meissner_frames_new(const struct meissner_network *network,
                                         const struct meissner_frames_options *options,
                                         struct meissner_frames **result);

// Pushes one or more whole frames, one after the other: `length` values in the order (frame,
// channel, row, column). If any value is not finite, no frame is taken.
enum meissner_status meissner_frames_push(const struct meissner_frames *frames,
                                          const float *values,
                                          size_t length);

// Predicts after the last frame: writes the network's outputs in the order (channel, row, column)
// to `values`, which has room for `length` values, and facts about the prediction to `prediction`,
// which may be NULL. Nothing is computed if `length` is less than the number of outputs.
enum meissner_status meissner_frames_predict(const struct meissner_frames *frames,
                                             float *values,
                                             size_t length,
                                             struct meissner_prediction *prediction);

// Sets the engine to the state before the first frame. Counters stay.
enum meissner_status meissner_frames_reset(const struct meissner_frames *frames);

// Counts of pixels for each layer; `meissner_network_info` has the number of layers. Allocates
// temporary memory.
enum meissner_status meissner_frames_layer_counters(const struct meissner_frames *frames,
                                                    struct meissner_layer_counters *layers,
                                                    size_t length);

// Writes the state as bytes, as `meissner_engine_snapshot` does.
enum meissner_status meissner_frames_snapshot(const struct meissner_frames *frames,
                                              uint8_t *bytes,
                                              size_t capacity,
                                              size_t *length);

// Sets the engine to the state of a snapshot of an engine with the same network and options.
// Allocates.
enum meissner_status meissner_frames_restore(const struct meissner_frames *frames,
                                             const uint8_t *bytes,
                                             size_t length);

// Ends a frame engine. Waits for the call of another thread that is using it.
void meissner_frames_release(struct meissner_frames *frames);

// Starts a thread that owns an engine and reads from a queue. `input` is for the thread that has
// the events, `live` for the thread that needs predictions. The live engine starts in the current
// state of `engine`, which stays the caller's. `options` may be NULL. Allocates.
enum meissner_status meissner_live_new(const struct meissner_engine *engine,
                                       const struct meissner_live_options *options,
                                       struct meissner_input **input,
                                       struct meissner_live **live);

// Pushes `length` events in order: each enters the queue, or is dropped and counted. Waits only
// with MEISSNER_OVERLOAD_BLOCK.
enum meissner_status meissner_input_push_events(const struct meissner_input *input,
                                                const struct meissner_event *events,
                                                size_t length);

// As `meissner_input_push_events`, from arrays like those of `meissner_engine_push_arrays`.
enum meissner_status meissner_input_push_arrays(const struct meissner_input *input,
                                                const int64_t *t_us,
                                                const uint16_t *x,
                                                const uint16_t *y,
                                                const int8_t *polarity,
                                                size_t length);

// Advances the clock to `t_us` after the events pushed so far. No earlier event may follow: it
// would be late.
enum meissner_status meissner_input_advance(const struct meissner_input *input, int64_t t_us);

// Gives the prediction for all events pushed so far or, after `deadline_ns` nanoseconds, the
// newest finished prediction, with its age; UINT64_MAX waits for all events. Writes the network's
// outputs to `values`, which has room for `length` values, and facts about the prediction to
// `timely`, which may be NULL.
enum meissner_status meissner_live_predict(const struct meissner_live *live,
                                           uint64_t deadline_ns,
                                           float *values,
                                           size_t length,
                                           struct meissner_timely *timely);

// Counts of pushed events.
enum meissner_status meissner_live_counters(const struct meissner_live *live,
                                            struct meissner_queue_counters *counters);

// The engine's counts of events, as of the newest prediction or of a later batch.
enum meissner_status meissner_live_event_counters(const struct meissner_live *live,
                                                  struct meissner_counters *counters);

// Ends a live engine, as `meissner_live_release` does, and returns its engine through `engine`.
// Waiting events are discarded: predict first with a deadline of UINT64_MAX so that the engine
// takes them. While another thread is in a call with `live`, the status is MEISSNER_BUSY and
// nothing has changed. After MEISSNER_OK and MEISSNER_PANICKED, the handle has ended.
enum meissner_status meissner_live_close(struct meissner_live *live, struct meissner_engine **engine);

// Ends a live engine and its thread. Waits for the call of another thread that is using it.
// Waiting events are discarded.
void meissner_live_release(struct meissner_live *live);

// Ends the sensor's side. Waits for the call of another thread that is using it. The controller's
// side keeps working.
void meissner_input_release(struct meissner_input *input);

// Sets the function that receives warnings: about weights that are untrained or were trained on
// another sensor, and about lost events, at most once a second for each engine. NULL, the default,
// drops the warnings; `meissner_network_warnings` and `meissner_engine_warnings` return them. The
// function must not call the library and must not unwind. After this call has returned, the
// previous function is not called any more.
void meissner_set_log(meissner_log function, void *user);

// Makes a network. `network` is the name of a network that comes with the library
// ("tactigraph-past"), or the path of a description. `weights` is the path of a safetensors file
// or of a PyTorch state dict; NULL for the weights that come with the library. `options` may be
// NULL. Allocates.
enum meissner_status meissner_network_open(const char *network,
                                           const char *weights,
                                           const struct meissner_network_options *options,
                                           struct meissner_network **result);

// Makes a network from the text of a description and the bytes of a weights file. `options` may be
// NULL. Allocates.
enum meissner_status meissner_network_from_bytes(const char *description,
                                                 size_t description_length,
                                                 const uint8_t *weights,
                                                 size_t weights_length,
                                                 const struct meissner_network_options *options,
                                                 struct meissner_network **result);

// Facts about a network.
enum meissner_status meissner_network_describe(const struct meissner_network *network,
                                               struct meissner_network_info *info);

// The name of value `index` of a prediction, and its unit. Either pointer may be NULL. The strings
// belong to the network. The values of an image have one name.
enum meissner_status meissner_network_output(const struct meissner_network *network,
                                             size_t index,
                                             const char **name,
                                             const char **unit);

// Writes the warnings about a network to `text`, one on each line, and the number of bytes with
// the NUL at the end to `length`. `text` has room for `capacity` bytes. The warnings are about
// weights that were drawn from a seed, or trained on other graphs or frames. If there is too
// little room, only `length` is written: call with a `capacity` of 0 to get it. Allocates.
enum meissner_status meissner_network_warnings(const struct meissner_network *network,
                                               char *text,
                                               size_t capacity,
                                               size_t *length);

// The name of network `index` among those that come with the library, or NULL after the last. The
// pointer stays valid.
const char *meissner_shipped_network(size_t index);

// Ends a network. Its engines keep working.
void meissner_network_release(struct meissner_network *network);

// What the last failed call of this thread expected and found, in UTF-8. The text is valid until
// another call of this thread fails, and empty before the first failure.
const char *meissner_error_text(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MEISSNER_H */
