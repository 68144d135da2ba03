// Mistakes on purpose: a sanitized process that stays silent about them is watching nothing.
#include <thread>

extern "C" int race() {
  int count = 0;
  std::thread other([&] {
    for (int i = 0; i < 1000; ++i) ++count;
  });
  for (int i = 0; i < 1000; ++i) ++count;
  other.join();
  return count;
}

extern "C" int read_after_the_end() {
  int* numbers = new int[4]{};
  volatile int end = 4;
  const int beyond = numbers[end];
  delete[] numbers;
  return beyond;
}
