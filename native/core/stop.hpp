// Work that can be stopped from outside: by a deadline, by a cancelling caller, by Ctrl-C.
//
// The owner of the work installs a Stop in each of its threads (ThisStop). Kernels call poll_stop() in every loop that
// may run for more than some hundredths of a second; it throws Stopped once the Stop is tripped. A poll reads one
// atomic, does nothing if no Stop is installed, and never changes the result of work that completes.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace rlacd {

struct Stopped : std::exception {
  const char* what() const noexcept override { return "the work was stopped"; }
};

class Stop {
 public:
  ~Stop() { end(); }

  // Starts to watch the deadline. Also calls `look` (which may throw) about ten times a second in the calling thread,
  // as long as that thread polls.
  void begin(std::function<void()> look);
  void end();

  // Sets the time left from now on; infinity lifts the deadline. Clears the tripped state.
  void arm(double seconds);
  void trip() { attention_ |= kTripped; }
  // Trips at this poll, counted from now: for tests that must not depend on time.
  void trip_after(std::int64_t polls);
  // While shielded, polls do not throw: for work that must be completed.
  void shield(bool on) { shielded_ = on; }

  // Time until the deadline; infinite if there is none, or if the Stop is shielded.
  double seconds_left() const;
  bool is_tripped() const { return (attention_ & kTripped) != 0; }
  void poll() {
    if (attention_.load(std::memory_order_relaxed) != 0) attend();
  }

 private:
  using Time = std::chrono::steady_clock::time_point;
  enum : std::uint32_t { kTripped = 1, kLook = 2, kCounting = 4, kUnwatched = 8 };

  void attend();
  void watch();
  bool is_late() const { return std::chrono::steady_clock::now() >= deadline_.load(); }

  std::atomic<std::uint32_t> attention_{0};  // why a poll has more to do than return
  std::atomic<bool> shielded_{false};
  std::atomic<std::int64_t> polls_left_{0};
  std::atomic<Time> deadline_{Time::max()};
  std::function<void()> look_;
  bool is_looking_ = false;  // within `look`, whose callees may poll
  std::thread::id looks_;
  std::thread watcher_;
  std::mutex guard_;
  std::condition_variable changed_;
  bool is_over_ = false;
};

// The Stop of this thread, or null.
inline thread_local Stop* this_stop = nullptr;

// Installs a Stop in this thread for the lifetime of this object.
class ThisStop {
 public:
  explicit ThisStop(Stop* stop) : before_(this_stop) { this_stop = stop; }
  ~ThisStop() { this_stop = before_; }
  ThisStop(const ThisStop&) = delete;
  ThisStop& operator=(const ThisStop&) = delete;

 private:
  Stop* before_;
};

inline void poll_stop() {
  if (this_stop != nullptr) this_stop->poll();
}
// At every 256th of the steps of a loop that are too quick for more.
template <class Integer>
void poll_stop(Integer step) {
  if (step % 256 == 0) poll_stop();
}

}  // namespace rlacd
