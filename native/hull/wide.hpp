// Functions that are compiled twice: for every processor, and with wider registers for those that have them.
//
// The choice is made when the library is loaded. Both give the same bits: no operations are fused.
#pragma once

#include <limits>  // tells which C library this is

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which are not there yet when it is decided
#define RLACD_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define RLACD_WIDE
#endif
