#include "core/stop.hpp"

#include <cmath>
#include <limits>
#include <system_error>

namespace rlacd {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kBetweenLooks(100);
constexpr double kForEver = 1e8;  // seconds; a longer time would overflow

}  // namespace

void Stop::begin(std::function<void()> look) {
  end();
  look_ = std::move(look);
  looks_ = std::this_thread::get_id();
  is_over_ = false;
  attention_ = 0;
  try {
    watcher_ = std::thread([this] { watch(); });
  } catch (const std::system_error&) {
    attention_ |= kUnwatched;  // the system grants no more threads: polls read the clock instead
  }
}

void Stop::end() {
  {
    const std::lock_guard<std::mutex> lock(guard_);
    is_over_ = true;
  }
  changed_.notify_all();
  if (watcher_.joinable()) watcher_.join();
  look_ = nullptr;
}

void Stop::arm(double seconds) {
  Time deadline = Time::max();
  if (seconds < kForEver)
    deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                  std::chrono::duration<double>(std::fmax(seconds, -kForEver)));
  {
    const std::lock_guard<std::mutex> lock(guard_);
    deadline_ = deadline;
    attention_ &= ~static_cast<std::uint32_t>(kTripped | kCounting);
    if (is_late()) trip();
  }
  changed_.notify_all();
}

double Stop::seconds_left() const {
  const Time deadline = deadline_;
  if (shielded_ || deadline == Time::max()) return std::numeric_limits<double>::infinity();
  return std::chrono::duration<double>(deadline - Clock::now()).count();
}

void Stop::trip_after(std::int64_t polls) {
  polls_left_ = polls;
  attention_ |= kCounting;
}

void Stop::attend() {
  const std::uint32_t bits = attention_;
  if ((bits & kUnwatched) != 0 && is_late()) trip();
  if (shielded_) return;
  if ((bits & kCounting) != 0 && polls_left_.fetch_sub(1) <= 1) trip();
  if ((bits & (kLook | kUnwatched)) != 0 && look_ && std::this_thread::get_id() == looks_ && !is_looking_) {
    attention_ &= ~static_cast<std::uint32_t>(kLook);
    struct Looking {
      bool& flag;
      explicit Looking(bool& is_looking) : flag(is_looking) { flag = true; }
      ~Looking() { flag = false; }
    } const looking(is_looking_);
    look_();
  }
  if (is_tripped()) throw Stopped();
}

void Stop::watch() {
  std::unique_lock<std::mutex> lock(guard_);
  while (!is_over_) {
    const Time next = Clock::now() + kBetweenLooks;
    const Time deadline = deadline_;
    changed_.wait_until(lock, is_tripped() ? next : std::min(next, deadline));
    if (is_late()) trip();
    if (Clock::now() >= next) attention_ |= kLook;
  }
}

}  // namespace rlacd
