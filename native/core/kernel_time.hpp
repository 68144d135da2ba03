// CPU time that kernels take of a thread, measured only in runs that are traced (src/rlacd/run/trace.py).
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>

namespace rlacd {

// Sums over a thread's kernels so far: seconds without the GIL, those in loops shared with other threads, the seconds
// of all threads in these loops, and the number of kernels.
struct KernelTime {
  double unlocked = 0, in_loops = 0, of_loops = 0;
  std::int64_t kernels = 0;
};

inline std::atomic<bool> is_timed{false};
inline thread_local KernelTime kernel_time;

// CPU seconds of this thread; those on the clock where no such clock is known. 0 unless kernels are timed.
inline double thread_seconds() {
  if (!is_timed.load(std::memory_order_relaxed)) return 0;
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
#else
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
#endif
}

}  // namespace rlacd
