// A parallel loop over independent items whose results do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/kernel_time.hpp"
#include "core/stop.hpp"

namespace rlacd {

inline int resolve_threads(int threads) {
  return threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
}

// Calls task(i) once for every i in [0, count). Items are handed out in order. Each must write only to its own slot, so
// that the result does not depend on the number of threads. The first exception is rethrown here. What stops this
// thread stops all of them.
template <class Task>
void parallel_for(std::size_t count, int threads, const Task& task) {
  const std::size_t workers = std::min<std::size_t>(resolve_threads(threads), count);
  if (workers <= 1) {
    for (std::size_t i = 0; i < count; ++i) {
      poll_stop();
      task(i);
    }
    return;
  }
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_guard;
  const auto fail = [&] {
    const std::lock_guard<std::mutex> lock(failure_guard);
    if (!failure) failure = std::current_exception();
    next = count;
  };
  const auto work = [&] {
    for (std::size_t i; (i = next.fetch_add(1)) < count;) {
      try {
        poll_stop();
        task(i);
      } catch (...) {
        fail();
      }
    }
  };
  Stop* const stop = this_stop;
  std::mutex running_guard;
  std::condition_variable finished;
  std::size_t running = 0;
  double helped = 0;
  std::vector<std::thread> pool;
  pool.reserve(workers - 1);
  try {
    for (std::size_t w = 1; w < workers; ++w) {
      pool.emplace_back([&] {
        const ThisStop same(stop);
        const double begun = thread_seconds();
        work();
        const std::lock_guard<std::mutex> lock(running_guard);
        helped += thread_seconds() - begun;
        --running;
        finished.notify_all();
      });
      const std::lock_guard<std::mutex> lock(running_guard);
      ++running;
    }
  } catch (const std::system_error&) {
    // The system grants no more threads: those already started do all the work.
  }
  const double begun = thread_seconds();
  work();
  const double own = thread_seconds() - begun;
  while (stop != nullptr) {  // only this thread can check whether it must stop
    {
      std::unique_lock<std::mutex> lock(running_guard);
      if (finished.wait_for(lock, std::chrono::milliseconds(50), [&] { return running == 0; })) break;
    }
    try {
      stop->poll();
    } catch (...) {
      fail();
    }
  }
  for (std::thread& thread : pool) thread.join();
  kernel_time.in_loops += own;
  kernel_time.of_loops += own + helped;
  if (failure) std::rethrow_exception(failure);
}

}  // namespace rlacd
