#include "base/interrupts.hpp"

#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <mutex>
#include <thread>

namespace rlacd {
namespace {

using Handler = void (*)(int);

constexpr std::chrono::milliseconds kBetweenLooks(50);
constexpr int kQuit = 2;  // the first interrupt asks for the result so far

volatile std::sig_atomic_t interrupts = 0;
Handler others = SIG_DFL;

void count(int number) {
  std::signal(SIGINT, count);  // some systems forget it
  if (interrupts < kQuit) interrupts = interrupts + 1;
  if (others != SIG_DFL && others != SIG_IGN) others(number);
}

class Watcher {
 public:
  ~Watcher() { end(); }

  void begin(int code, double grace) {
    end();
    is_over_ = false;
    watcher_ = std::thread([this, code, grace] { watch(code, grace); });
  }

  void end() {
    {
      const std::lock_guard<std::mutex> lock(guard_);
      is_over_ = true;
    }
    changed_.notify_all();
    if (watcher_.joinable()) watcher_.join();
  }

 private:
  void watch(int code, double grace) {
    std::unique_lock<std::mutex> lock(guard_);
    const auto has_ended = [this] { return is_over_; };
    while (interrupts < kQuit)
      if (changed_.wait_for(lock, kBetweenLooks, has_ended)) return;
    if (!changed_.wait_for(lock, std::chrono::duration<double>(grace), has_ended)) std::_Exit(code);
  }

  std::mutex guard_;
  std::condition_variable changed_;
  std::thread watcher_;
  bool is_over_ = true;
} watcher;

}  // namespace

void count_interrupts(int code, double grace) {
  forget_interrupts();
  interrupts = 0;
  watcher.begin(code, grace);
  others = std::signal(SIGINT, count);
}

void forget_interrupts() {
  if (others != SIG_DFL) std::signal(SIGINT, others);
  others = SIG_DFL;
  watcher.end();
}

}  // namespace rlacd
