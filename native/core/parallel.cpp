#include "core/parallel.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>

#ifndef _WIN32
#include <pthread.h>
#endif

namespace rlacd {
namespace {

constexpr std::chrono::milliseconds kBetweenLooks(50);

class Loop {
 public:
  Loop(std::size_t count, std::size_t helpers, const std::function<void(std::size_t)>& task)
      : seats(helpers), count_(count), task_(task) {}

  // Takes items until none is left.
  void work() {
    const ThisStop same(stop_);
    for (std::size_t i; (i = next_.fetch_add(1)) < count_;) attempt([&] { task_(i); });
  }

  // After an exception no item begins any more.
  template <class Action>
  void attempt(const Action& action) {
    try {
      action();
    } catch (...) {
      const std::lock_guard<std::mutex> lock(failure_guard_);
      if (!failure_) failure_ = std::current_exception();
      next_ = count_;
    }
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

  // Guarded by the pool:
  std::size_t seats, inside = 0;  // for helpers to come; helpers at work
  std::condition_variable left;

 private:
  const std::size_t count_;
  const std::function<void(std::size_t)>& task_;
  Stop* const stop_ = this_stop;
  std::atomic<std::size_t> next_{0};
  std::exception_ptr failure_;
  std::mutex failure_guard_;
};

// As many threads as one loop ever asked for. They wait for loops that have seats, first come, first served.
class Pool {
 public:
  void open(Loop& loop) {
    const std::lock_guard<std::mutex> lock(guard_);
    open_.push_back(&loop);
    try {
      for (; threads_ < loop.seats; ++threads_) std::thread([this] { live(); }).detach();
    } catch (const std::system_error&) {
      // The system grants no more threads: those that there are do all the work.
    }
    opened_.notify_all();
  }

  // Lets no more helpers in, and waits until those inside have left.
  void close(Loop& loop) {
    std::unique_lock<std::mutex> lock(guard_);
    if (loop.seats > 0) open_.erase(std::find(open_.begin(), open_.end(), &loop));
    while (!loop.left.wait_for(lock, kBetweenLooks, [&] { return loop.inside == 0; })) {
      lock.unlock();
      loop.attempt([] { poll_stop(); });  // only the loop's own thread can check whether it must stop
      lock.lock();
    }
  }

 private:
  [[noreturn]] void live() {
    std::unique_lock<std::mutex> lock(guard_);
    for (;;) {
      opened_.wait(lock, [this] { return !open_.empty(); });
      Loop& loop = *open_.front();
      if (--loop.seats == 0) open_.pop_front();
      ++loop.inside;
      lock.unlock();
      loop.work();
      lock.lock();
      if (--loop.inside == 0) loop.left.notify_all();
    }
  }

  std::mutex guard_;
  std::condition_variable opened_;
  std::deque<Loop*> open_;  // those with seats
  std::size_t threads_ = 0;
};

// Never destroyed: its threads wait for as long as the process lives. A fork has no other threads, so it begins anew.
std::atomic<Pool*> the_pool{nullptr};
#ifndef _WIN32
[[maybe_unused]] const int watches_forks = pthread_atfork(nullptr, nullptr, [] { the_pool = nullptr; });
#endif

Pool& pool() {
  Pool* found = the_pool;
  if (found != nullptr) return *found;
  Pool* const made = new Pool;
  if (the_pool.compare_exchange_strong(found, made)) return *made;
  delete made;
  return *found;
}

}  // namespace

void share(std::size_t count, std::size_t helpers, const std::function<void(std::size_t)>& task) {
  Loop loop(count, helpers, task);
  Pool& helping = pool();
  helping.open(loop);
  loop.work();
  helping.close(loop);
  loop.rethrow();
}

}  // namespace rlacd
