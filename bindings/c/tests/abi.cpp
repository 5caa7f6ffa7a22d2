// The classes of meissner.hpp, for sanitizers and valgrind.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "meissner.hpp"

#define ASSERT(condition)                                                 \
  do {                                                                    \
    if (!(condition)) {                                                   \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::exit(1);                                                       \
    }                                                                     \
  } while (0)

static std::vector<meissner_event> some_events() {
  std::vector<meissner_event> events;
  std::uint32_t state = 3;
  for (int i = 0; i < 2000; i++) {
    state = state * 1103515245u + 12345u;
    events.push_back({i * 80, static_cast<std::uint16_t>(state >> 8 & 63), static_cast<std::uint16_t>(state >> 16 & 63),
                      static_cast<std::int8_t>(state >> 24 & 1)});
  }
  return events;
}

static bool same(const std::vector<float> &a, const std::vector<float> &b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

int main() {
  const auto events = some_events();
  const auto network = meissner::Network::open("tactip-past");
  ASSERT(network.info().outputs == 3 && network.output(0).first == "depth" && network.output(0).second == "mm");
  ASSERT(meissner::shipped_networks().size() > 20);

  meissner::Engine engine(network, 64, 64);
  for (const auto &event : events) engine.push(event);
  const auto first = engine.predict();
  ASSERT(first.values.size() == 3 && first.of.nodes > 100 && engine.counters().accepted == events.size());
  ASSERT(network.warnings().empty() && engine.warnings().find("not 64x64\n") != std::string::npos);
  auto copied = engine.clone();
  const auto bytes = engine.snapshot();
  engine.reset();
  ASSERT(!same(engine.predict().values, first.values));
  engine.restore(bytes);
  ASSERT(same(engine.predict().values, first.values) && same(copied.predict().values, first.values));

  engine.reset();
  auto [input, live] = meissner::Live::start(engine);
  std::thread sensor([&events, &input = input] { input.push(events); });
  sensor.join();
  ASSERT(same(live.predict().values, first.values) && live.counters().delivered == events.size());
  // The counts of the snapshot plus the counts since then.
  ASSERT(live.event_counters().accepted == 2 * events.size());
  auto back = std::move(live).close();
  ASSERT(same(back.predict().values, first.values));

  const auto slip = meissner::Network::open("slip-lstm");
  meissner::Frames frames(slip);
  const auto info = slip.info();
  frames.push(std::vector<float>(static_cast<std::size_t>(info.input_channels) * info.input_height * info.input_width, 0.5f));
  const auto kept = frames.snapshot();
  const auto classes = frames.predict();
  frames.reset();
  frames.restore(kept);
  ASSERT(same(frames.predict().values, classes.values) && classes.of.nodes == 1);

  try {
    meissner::Engine wrong(slip, 64, 64);
    ASSERT(false);
  } catch (const meissner::Error &error) {
    ASSERT(error.status() == MEISSNER_WRONG_NETWORK && std::string(error.what()).find("slip-lstm") != std::string::npos);
  }
  std::puts("the C++ interface holds");
  return 0;
}
