// Ends the process after a second SIGINT (Ctrl-C) or SIGTERM, even while the interpreter cannot run its own handlers: a
// library that holds the GIL heeds neither a Stop nor a signal.
#pragma once

namespace rlacd {

// Counts both signals from now on, besides what Python does about them. `grace` seconds after the second one the
// process exits with `code`, unless `forget_interrupts` comes before.
void count_interrupts(int code, double grace);
void forget_interrupts();

}  // namespace rlacd
