// A triangle surface with the structures its queries need, built once.
#pragma once

#include <memory>
#include <mutex>

#include "surface/bvh.hpp"
#include "surface/winding.hpp"

namespace rlacd {

class Surface {
 public:
  explicit Surface(const Mesh& mesh, int threads = 1) : bvh_(mesh, threads) {}
  Surface(const Surface&) = delete;  // winding_ refers to bvh_
  Surface& operator=(const Surface&) = delete;

  const Bvh& bvh() const { return bvh_; }
  const Winding& winding() const {
    std::call_once(winding_made_, [this] { winding_ = std::make_unique<Winding>(bvh_); });
    return *winding_;
  }

 private:
  Bvh bvh_;
  mutable std::once_flag winding_made_;
  mutable std::unique_ptr<Winding> winding_;
};

// The tree of one surface that several tests may need, made by the first of them.
class TreeCache {
 public:
  const Bvh& of(const Mesh& surface) const {
    std::call_once(made_, [&] { bvh_ = std::make_unique<Bvh>(surface); });
    return *bvh_;
  }

 private:
  mutable std::once_flag made_;
  mutable std::unique_ptr<Bvh> bvh_;
};

}  // namespace rlacd
