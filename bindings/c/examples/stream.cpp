// As stream.c, in C++17.
#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

#include "meissner.hpp"

static meissner_event event(int number) {
  const double angle = number * 0.1, radius = 20.0 + number * 0.003;
  return {number * 10, static_cast<std::uint16_t>(173.0 + radius * std::cos(angle)),
          static_cast<std::uint16_t>(130.0 + radius * std::sin(angle)),
          static_cast<std::int8_t>(number % 3 == 0 ? -1 : 1)};
}

// ANCHOR: book
int main() try {
  const auto network = meissner::Network::open("tactigraph-past");
  meissner::Engine engine(network, 346, 260);
  const auto [name, unit] = network.output(0);
  std::vector<meissner_event> block;
  for (int number = 0; number < 20000; number++) {
    block.push_back(event(number));
    if (block.size() < 4096) continue;
    engine.push(block);
    block.clear();
    const auto prediction = engine.predict();
    std::printf("%5.1f ms  %s %7.4f %s\n", static_cast<double>(prediction.of.t_us) / 1000.0, name.c_str(),
                static_cast<double>(prediction.values[0]), unit.c_str());
  }
  return 0;
} catch (const std::exception &error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
// ANCHOR_END: book
