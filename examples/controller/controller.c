// The controller in C: 1 kHz, events from UDP, predictions by a deadline, targets for the wrist of a fingertip.
//
//     make -C examples/controller
//     target/release/fingertip &
//     target/c/controller
//
// The README beside this file describes the datagrams and the control law. The program assumes a little-endian machine.
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "meissner.h"

enum { EVENTS_PORT = 5000, TARGETS_PORT = 5001, PERIOD_NS = 1000000, DEADLINE_NS = 900000, HOLD = 2 };
static const double GAIN = 0.8;

typedef struct {
  uint64_t cycle;
  double roll, pitch;  // of the wrist, in radians
} target;

typedef struct {
  int64_t t_us;
  double depth_mm, roll, pitch;
  uint32_t phase, tap;
} state;

_Static_assert(sizeof(target) == 24 && sizeof(state) == 40 && sizeof(meissner_event) == 16, "datagrams have no gaps");

static atomic_bool ended;

// Ends the program with the text of the failure.
static void check(meissner_status status) {
  if (status != MEISSNER_OK) {
    fprintf(stderr, "%s\n", meissner_error_text());
    exit(1);
  }
}

static void check_call(int result, const char *what) {
  if (result < 0) {
    perror(what);
    exit(1);
  }
}

static void report(const char *what, int error) {
  printf("%s: %s%s\n", what, error ? "refused: " : "granted", error ? strerror(error) : "");
}

// A thread starts with the priority of the thread that starts it.
static void raise_to(const char *whose, int priority) {
  const struct sched_param wanted = {.sched_priority = priority};
  report(whose, pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted));
}

static int64_t now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void sleep_until(int64_t ns) {
  const struct timespec at = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
  }
}

static struct sockaddr_in local(uint16_t port) {
  struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// The sensor's thread: records of 16 bytes are events in their memory layout. An empty datagram ends the stream.
static void *feed(void *argument) {
  meissner_input *input = argument;
  const int events_socket = socket(AF_INET, SOCK_DGRAM, 0);
  check_call(events_socket, "socket");
  const struct timeval patience = {.tv_usec = 20000};
  check_call(setsockopt(events_socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), "setsockopt");
  const struct sockaddr_in address = local(EVENTS_PORT);
  check_call(bind(events_socket, (const struct sockaddr *)&address, sizeof address), "bind");
  static meissner_event events[4096];
  while (!ended) {
    const ssize_t length = recv(events_socket, events, sizeof events, 0);
    if (length < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    check_call((int)length, "recv");
    if (length == 0) break;
    check(meissner_input_push_events(input, events, (size_t)length / sizeof *events));
  }
  ended = true;
  close(events_socket);
  return NULL;
}

// Upper limits of the times that each row counts, in microseconds.
enum { ROWS = 9 };
static const int64_t ROWS_US[ROWS] = {5, 10, 20, 50, 100, 200, 500, 900, INT64_MAX};

static void count(uint64_t rows[ROWS], int64_t ns) {
  int row = 0;
  while (row < ROWS - 1 && ns > ROWS_US[row] * 1000) row++;
  rows[row]++;
}

int main(int argc, char **argv) {
  const uint64_t most = argc > 1 ? strtoull(argv[1], NULL, 10) : UINT64_MAX;
  meissner_network *network = NULL;
  meissner_engine *engine = NULL;
  meissner_input *input = NULL;
  meissner_live *live = NULL;
  check(meissner_network_open("tactigraph-past", NULL, NULL, &network));
  check(meissner_engine_new(network, 346, 260, NULL, &engine));

  report("locked memory", mlockall(MCL_CURRENT | MCL_FUTURE) ? errno : 0);
  raise_to("priority of the engine's thread", 60);
  // Short batches: the engine begins a prediction two batches before the deadline.
  const meissner_live_options options = {.size = sizeof options, .batch = 8};
  check(meissner_live_new(engine, &options, &input, &live));
  raise_to("priority of the feed", 70);
  pthread_t feeding;
  if (pthread_create(&feeding, NULL, feed, input) != 0) return 1;
  raise_to("priority of the loop", 80);

  const int robot = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
  check_call(robot, "socket");
  const struct sockaddr_in address = local(TARGETS_PORT);
  check_call(connect(robot, (const struct sockaddr *)&address, sizeof address), "connect");

  static uint64_t late_rows[ROWS], answer_rows[ROWS];
  state newest = {0};
  target wanted = {0};
  uint64_t late = 0, stale = 0;
  int64_t due = now_ns() + PERIOD_NS;
  for (; wanted.cycle < most && !ended; wanted.cycle++, due += PERIOD_NS) {
    sleep_until(due);
    const int64_t woke = now_ns();
    state read;
    while (recv(robot, &read, sizeof read, 0) == (ssize_t)sizeof read) newest = read;

    const int64_t left = due + DEADLINE_NS - now_ns();
    float angles[2];
    meissner_timely timely = {.size = sizeof timely};
    check(meissner_live_predict(live, left > 0 ? (uint64_t)left : 0, angles, 2, &timely));
    const int64_t answered = now_ns();

    // While a press is held, the angle of the contact is the angle that the wrist must still turn.
    if (newest.phase == HOLD) {
      wanted.roll = newest.roll + GAIN * (double)angles[0];
      wanted.pitch = newest.pitch + GAIN * (double)angles[1];
    }
    send(robot, &wanted, sizeof wanted, 0);  // nobody may listen

    count(late_rows, woke - due);
    count(answer_rows, answered - woke);
    if (woke > due + DEADLINE_NS / 2) late++;
    else if (!timely.fresh || answered > due + DEADLINE_NS) stale++;
  }
  ended = true;
  pthread_join(feeding, NULL);

  printf("%llu cycles, deadlines missed: %llu woken late, %llu without a fresh prediction in time\n",
         (unsigned long long)wanted.cycle, (unsigned long long)late, (unsigned long long)stale);
  printf("%14s %12s %12s\n", "up to us", "woken late", "answer");
  for (int row = 0; row < ROWS; row++) {
    if (row < ROWS - 1) printf("%14lld", (long long)ROWS_US[row]);
    else printf("%14s", "more");
    printf(" %12llu %12llu\n", (unsigned long long)late_rows[row], (unsigned long long)answer_rows[row]);
  }
  meissner_queue_counters counters = {.size = sizeof counters};
  check(meissner_live_counters(live, &counters));
  printf("%llu events, %llu dropped; last tap %u, wrist at %.2f and %.2f degrees\n",
         (unsigned long long)counters.offered, (unsigned long long)counters.dropped_oldest, newest.tap,
         newest.roll * 57.29578, newest.pitch * 57.29578);
  close(robot);
  meissner_input_release(input);
  meissner_live_release(live);
  meissner_engine_release(engine);
  meissner_network_release(network);
  return 0;
}
