// Predictions from a stream of events: a disc is pressed on the sensor, and its rim grows for 200 ms.
//
//     make -C bindings/c run
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "meissner.h"

enum { EVENTS = 20000, BLOCK = 256 };

// Ends the program with the text of the failure.
static void check(meissner_status status) {
  if (status != MEISSNER_OK) {
    fprintf(stderr, "%s\n", meissner_error_text());
    exit(1);
  }
}

static meissner_event event(int number) {
  const double angle = number * 0.1, radius = 20.0 + number * 0.003;
  const meissner_event made = {
      .t_us = number * 10,
      .x = (uint16_t)(173.0 + radius * cos(angle)),
      .y = (uint16_t)(130.0 + radius * sin(angle)),
      .polarity = number % 3 == 0 ? -1 : 1,
  };
  return made;
}

// ANCHOR: book
int main(void) {
  meissner_network *network = NULL;
  check(meissner_network_open("tactigraph-past", NULL, NULL, &network));
  meissner_engine *engine = NULL;
  check(meissner_engine_new(network, 346, 260, NULL, &engine));

  const char *names[2], *units[2];
  for (size_t i = 0; i < 2; i++) check(meissner_network_output(network, i, &names[i], &units[i]));

  meissner_event block[BLOCK];
  for (int first = 0; first < EVENTS; first += BLOCK) {
    size_t length = 0;
    while (length < BLOCK && first + (int)length < EVENTS) {
      block[length] = event(first + (int)length);
      length++;
    }
    check(meissner_engine_push_events(engine, block, length, NULL));
    if (first / BLOCK % 16 != 15) continue;
    float values[2];
    meissner_prediction prediction = {.size = sizeof prediction};
    check(meissner_engine_predict(engine, values, 2, &prediction));
    printf("%5.1f ms  %5llu events  %s %7.4f %s  %s %7.4f %s\n", (double)prediction.t_us / 1000.0,
           (unsigned long long)prediction.nodes, names[0], values[0], units[0], names[1], values[1], units[1]);
  }
  meissner_counters counters = {.size = sizeof counters};
  check(meissner_engine_counters(engine, &counters));
  printf("%llu events pushed, %llu accepted, %llu left the window\n", (unsigned long long)counters.pushed,
         (unsigned long long)counters.accepted, (unsigned long long)counters.expired);
  meissner_engine_release(engine);
  // The names belong to the network.
  meissner_network_release(network);
  return 0;
}
// ANCHOR_END: book
