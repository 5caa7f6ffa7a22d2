// Meissner from C++17: the handles of meissner.h as classes that release themselves, and failures as exceptions.
//
//     auto network = meissner::Network::open("tactigraph-past");
//     meissner::Engine engine(network, 346, 260);
//     engine.push({t_us, x, y, polarity});
//     std::vector<float> angles = engine.predict().values;
//
// The comments of meissner.h hold here too. `predict_into` allocates nothing.
#ifndef MEISSNER_HPP
#define MEISSNER_HPP

#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "meissner.h"

namespace meissner {

// A call that failed: its status, and what was expected and found.
class Error : public std::runtime_error {
 public:
  explicit Error(meissner_status status) : std::runtime_error(meissner_error_text()), status_(status) {}
  meissner_status status() const { return status_; }

 private:
  meissner_status status_;
};

inline void check(meissner_status status) {
  if (status != MEISSNER_OK) throw Error(status);
}

namespace detail {

template <class T, void (*release)(T *)>
struct Release {
  void operator()(T *handle) const { release(handle); }
};

template <class T, void (*release)(T *)>
using Handle = std::unique_ptr<T, Release<T, release>>;

inline const char *text_or_null(const std::string &text) { return text.empty() ? nullptr : text.c_str(); }

// A struct of the interface, of this program's size.
template <class T>
T sized() {
  T made{};
  made.size = sizeof(T);
  return made;
}

// The bytes of a snapshot that `write(bytes, capacity, length)` writes.
template <class Write>
std::vector<std::uint8_t> bytes(Write write) {
  std::size_t length = 0;
  const meissner_status status = write(nullptr, 0, &length);
  if (status != MEISSNER_BUFFER_TOO_SMALL) check(status);
  std::vector<std::uint8_t> found(length);
  check(write(found.data(), found.size(), &length));
  found.resize(length);
  return found;
}

// The text that `write(text, capacity, length)` writes, without its NUL.
template <class Write>
std::string text(Write write) {
  const auto found = bytes([&write](std::uint8_t *bytes, std::size_t capacity, std::size_t *length) {
    return write(reinterpret_cast<char *>(bytes), capacity, length);
  });
  return {found.begin(), found.end() - 1};
}

}  // namespace detail

// Events whose parts are in separate arrays, as `meissner_engine_push_arrays` takes them.
struct Arrays {
  const std::int64_t *t_us;
  const std::uint16_t *x;
  const std::uint16_t *y;
  const std::int8_t *polarity;
  std::size_t length;
};

// The values of a prediction, and facts about it.
template <class Of>
struct Predicted {
  std::vector<float> values;
  Of of;
};
using Prediction = Predicted<meissner_prediction>;
using Timely = Predicted<meissner_timely>;

class Network {
 public:
  // A network of the library by its name, or a description by its path; weights by their path, or the library's weights.
  static Network open(const std::string &network, const std::string &weights = {},
                      const meissner_network_options &options = detail::sized<meissner_network_options>()) {
    meissner_network *made = nullptr;
    check(meissner_network_open(network.c_str(), detail::text_or_null(weights), &options, &made));
    return Network(made);
  }

  static Network from_bytes(const std::string &description, const std::vector<std::uint8_t> &weights,
                            const meissner_network_options &options = detail::sized<meissner_network_options>()) {
    meissner_network *made = nullptr;
    check(meissner_network_from_bytes(description.data(), description.size(), weights.data(), weights.size(), &options,
                                      &made));
    return Network(made);
  }

  meissner_network_info info() const {
    auto info = detail::sized<meissner_network_info>();
    check(meissner_network_describe(get(), &info));
    return info;
  }

  // The warnings of the library, one on each line.
  std::string warnings() const {
    return detail::text([this](char *text, std::size_t capacity, std::size_t *length) {
      return meissner_network_warnings(get(), text, capacity, length);
    });
  }

  // Name and unit of a value of a prediction.
  std::pair<std::string, std::string> output(std::size_t index) const {
    const char *name = nullptr, *unit = nullptr;
    check(meissner_network_output(get(), index, &name, &unit));
    return {name, unit};
  }

  const meissner_network *get() const { return handle_.get(); }

 private:
  explicit Network(meissner_network *handle) : handle_(handle) {}
  detail::Handle<meissner_network, meissner_network_release> handle_;
};

// Names of the networks that come with the library.
inline std::vector<std::string> shipped_networks() {
  std::vector<std::string> names;
  while (const char *name = meissner_shipped_network(names.size())) names.emplace_back(name);
  return names;
}

// A network over the events of a sliding window.
class Engine {
 public:
  Engine(const Network &network, std::uint16_t width, std::uint16_t height,
         const meissner_engine_options &options = detail::sized<meissner_engine_options>())
      : outputs_(network.info().outputs) {
    meissner_engine *made = nullptr;
    check(meissner_engine_new(network.get(), width, height, &options, &made));
    handle_.reset(made);
  }

  Engine(meissner_engine *handle, std::size_t outputs) : handle_(handle), outputs_(outputs) {}

  Engine clone() const {
    meissner_engine *made = nullptr;
    check(meissner_engine_clone(get(), &made));
    return {made, outputs_};
  }

  // Whether the event entered the window.
  bool push(const meissner_event &event) {
    bool accepted = false;
    check(meissner_engine_push(get(), event.t_us, event.x, event.y, event.polarity, &accepted));
    return accepted;
  }

  // Returns the number of events that entered the window.
  std::size_t push(const meissner_event *events, std::size_t length) {
    std::size_t accepted = 0;
    check(meissner_engine_push_events(get(), events, length, &accepted));
    return accepted;
  }

  std::size_t push(const std::vector<meissner_event> &events) { return push(events.data(), events.size()); }

  std::size_t push(const Arrays &events) {
    std::size_t accepted = 0;
    check(meissner_engine_push_arrays(get(), events.t_us, events.x, events.y, events.polarity, events.length, &accepted));
    return accepted;
  }

  void advance(std::int64_t t_us) { check(meissner_engine_advance(get(), t_us)); }

  Prediction predict() {
    Prediction found{std::vector<float>(outputs_), {}};
    found.of = predict_into(found.values.data(), found.values.size());
    return found;
  }

  meissner_prediction predict_into(float *values, std::size_t length) {
    auto prediction = detail::sized<meissner_prediction>();
    check(meissner_engine_predict(get(), values, length, &prediction));
    return prediction;
  }

  void reset() { check(meissner_engine_reset(get())); }

  meissner_counters counters() const {
    auto counters = detail::sized<meissner_counters>();
    check(meissner_engine_counters(get(), &counters));
    return counters;
  }

  std::vector<std::uint8_t> snapshot() const {
    return detail::bytes([this](std::uint8_t *bytes, std::size_t capacity, std::size_t *length) {
      return meissner_engine_snapshot(get(), bytes, capacity, length);
    });
  }

  void restore(const std::vector<std::uint8_t> &bytes) {
    check(meissner_engine_restore(get(), bytes.data(), bytes.size()));
  }

  // The warnings of the library, one on each line.
  std::string warnings() const {
    return detail::text([this](char *text, std::size_t capacity, std::size_t *length) {
      return meissner_engine_warnings(get(), text, capacity, length);
    });
  }

  std::size_t outputs() const { return outputs_; }
  meissner_engine *get() const { return handle_.get(); }

 private:
  detail::Handle<meissner_engine, meissner_engine_release> handle_;
  std::size_t outputs_;
};

// A network over frames.
class Frames {
 public:
  explicit Frames(const Network &network,
                  const meissner_frames_options &options = detail::sized<meissner_frames_options>())
      : outputs_(network.info().outputs) {
    meissner_frames *made = nullptr;
    check(meissner_frames_new(network.get(), &options, &made));
    handle_.reset(made);
  }

  // One or more whole frames.
  void push(const float *values, std::size_t length) { check(meissner_frames_push(get(), values, length)); }
  void push(const std::vector<float> &values) { push(values.data(), values.size()); }

  Prediction predict() {
    Prediction found{std::vector<float>(outputs_), {}};
    found.of = predict_into(found.values.data(), found.values.size());
    return found;
  }

  meissner_prediction predict_into(float *values, std::size_t length) {
    auto prediction = detail::sized<meissner_prediction>();
    check(meissner_frames_predict(get(), values, length, &prediction));
    return prediction;
  }

  void reset() { check(meissner_frames_reset(get())); }

  std::vector<std::uint8_t> snapshot() const {
    return detail::bytes([this](std::uint8_t *bytes, std::size_t capacity, std::size_t *length) {
      return meissner_frames_snapshot(get(), bytes, capacity, length);
    });
  }

  void restore(const std::vector<std::uint8_t> &bytes) {
    check(meissner_frames_restore(get(), bytes.data(), bytes.size()));
  }

  meissner_frames *get() const { return handle_.get(); }

 private:
  detail::Handle<meissner_frames, meissner_frames_release> handle_;
  std::size_t outputs_;
};

// The sensor's side of a live engine.
class Input {
 public:
  explicit Input(meissner_input *handle) : handle_(handle) {}

  void push(const meissner_event *events, std::size_t length) {
    check(meissner_input_push_events(get(), events, length));
  }
  void push(const std::vector<meissner_event> &events) { push(events.data(), events.size()); }
  void push(const Arrays &events) {
    check(meissner_input_push_arrays(get(), events.t_us, events.x, events.y, events.polarity, events.length));
  }
  void advance(std::int64_t t_us) { check(meissner_input_advance(get(), t_us)); }
  meissner_input *get() const { return handle_.get(); }

 private:
  detail::Handle<meissner_input, meissner_input_release> handle_;
};

// The controller's side of a live engine.
class Live {
 public:
  // Waits for all events that have been pushed.
  static constexpr std::uint64_t NO_DEADLINE = std::numeric_limits<std::uint64_t>::max();

  // Both sides of a live engine that starts in the state of `engine`.
  static std::pair<Input, Live> start(const Engine &engine,
                                      const meissner_live_options &options = detail::sized<meissner_live_options>()) {
    meissner_input *input = nullptr;
    meissner_live *live = nullptr;
    check(meissner_live_new(engine.get(), &options, &input, &live));
    return {Input(input), Live(live, engine.outputs())};
  }

  Timely predict(std::uint64_t deadline_ns = NO_DEADLINE) {
    Timely found{std::vector<float>(outputs_), {}};
    found.of = predict_into(deadline_ns, found.values.data(), found.values.size());
    return found;
  }

  meissner_timely predict_into(std::uint64_t deadline_ns, float *values, std::size_t length) {
    auto timely = detail::sized<meissner_timely>();
    check(meissner_live_predict(get(), deadline_ns, values, length, &timely));
    return timely;
  }

  meissner_queue_counters counters() const {
    auto counters = detail::sized<meissner_queue_counters>();
    check(meissner_live_counters(get(), &counters));
    return counters;
  }

  meissner_counters event_counters() const {
    auto counters = detail::sized<meissner_counters>();
    check(meissner_live_event_counters(get(), &counters));
    return counters;
  }

  // Ends the live engine and returns its engine. After MEISSNER_BUSY it is unchanged.
  Engine close() && {
    meissner_engine *engine = nullptr;
    check(meissner_live_close(get(), &engine));
    handle_.release();
    return {engine, outputs_};
  }

  meissner_live *get() const { return handle_.get(); }

 private:
  Live(meissner_live *handle, std::size_t outputs) : handle_(handle), outputs_(outputs) {}
  detail::Handle<meissner_live, meissner_live_release> handle_;
  std::size_t outputs_;
};

}  // namespace meissner

#endif  // MEISSNER_HPP
