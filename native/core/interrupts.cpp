#include "core/interrupts.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

namespace rlacd {
namespace {

using Handler = void (*)(int);

constexpr std::chrono::milliseconds kBetweenLooks(50);
constexpr int kQuit = 2;  // the first interrupt asks for the result so far

std::atomic<int> interrupts{0};  // written by the handler, so it must not need a lock
static_assert(std::atomic<int>::is_always_lock_free);
constexpr std::array<int, 2> kSignals{SIGINT, SIGTERM};
std::array<Handler, 2> others{SIG_DFL, SIG_DFL};

void count(int number) {
  std::signal(number, count);  // some systems forget it
  if (interrupts < kQuit) ++interrupts;
  const Handler other = others[number == SIGINT ? 0 : 1];
  if (other != SIG_DFL && other != SIG_IGN) other(number);
}

std::atomic<int> latest{0};  // of the watchers, which end once there is another number

void watch(int own, int code, double grace) {
  for (double left = grace; left > 0 && latest == own;) {
    std::this_thread::sleep_for(kBetweenLooks);
    if (interrupts >= kQuit) left -= std::chrono::duration<double>(kBetweenLooks).count();
  }
  if (latest == own) std::_Exit(code);
}

}  // namespace

void count_interrupts(int code, double grace) {
  forget_interrupts();
  interrupts = 0;
  std::thread(watch, ++latest, code, grace).detach();
  for (std::size_t i = 0; i < kSignals.size(); ++i) others[i] = std::signal(kSignals[i], count);
}

void forget_interrupts() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    if (others[i] != SIG_DFL) std::signal(kSignals[i], others[i]);
    others[i] = SIG_DFL;
  }
  ++latest;
}

}  // namespace rlacd
