// Invariants that sanitizer and debug builds check. They cost nothing in a release build: the condition is compiled but
// never evaluated.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace rlacd {

[[noreturn]] inline void invariant_broken(const char* invariant, const char* file, int line) {
  std::fprintf(stderr, "%s:%d: invariant broken: %s\n", file, line, invariant);
  std::abort();
}

}  // namespace rlacd

#ifdef RLACD_CHECK_INVARIANTS
#define RLACD_ASSERT(...) ((__VA_ARGS__) ? void(0) : ::rlacd::invariant_broken(#__VA_ARGS__, __FILE__, __LINE__))
#else
#define RLACD_ASSERT(...) static_cast<void>(sizeof((__VA_ARGS__) ? 1 : 0))
#endif
