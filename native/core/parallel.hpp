// A parallel loop over independent items whose results do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <thread>

#include "core/stop.hpp"

namespace rlacd {

inline int resolve_threads(int threads) {
  return threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
}

// Does the items of a loop in this thread and up to `helpers` others, which live as long as the process. This thread
// takes items too, so that a loop within an item of another ends whether or not a helper is free for it.
void share(std::size_t count, std::size_t helpers, const std::function<void(std::size_t)>& task);

// Items that one thread takes at a time: quick ones, like a distance, and slower ones, like a joint hull of small
// parts.
constexpr std::size_t kQuick = 64, kSlower = 8;

// Calls task(i) once for every i in [0, count). Items are handed out in order, `chunk` of them at a time. Each must
// write only to its own slot, so that the result does not depend on the number of threads. The first exception is
// rethrown here. What stops this thread stops all of them.
template <class Task>
void parallel_for(std::size_t count, int threads, const Task& task, std::size_t chunk = 1) {
  const std::size_t chunks = (count + chunk - 1) / chunk;
  const auto run = [&](std::size_t number) {
    poll_stop();
    for (std::size_t i = number * chunk; i < std::min(count, (number + 1) * chunk); ++i) task(i);
  };
  const std::size_t workers = std::min<std::size_t>(resolve_threads(threads), chunks);
  if (workers > 1) return share(chunks, workers - 1, run);
  for (std::size_t number = 0; number < chunks; ++number) run(number);
}

}  // namespace rlacd
