// What is made when it is first asked for, by whichever thread that is.
#pragma once

#include <mutex>
#include <optional>

namespace rlacd {

template <class T>
class Lazy {
 public:
  // make() returns what T is made of; after an exception it is tried again.
  template <class Make>
  const T& get(const Make& make) const {
    std::call_once(once_, [&] { made_.emplace(make()); });
    return *made_;
  }

 private:
  mutable std::once_flag once_;
  mutable std::optional<T> made_;
};

}  // namespace rlacd
