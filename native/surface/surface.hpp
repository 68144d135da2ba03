// A triangle surface with the structures its queries need, built once.
#pragma once

#include "core/lazy.hpp"
#include "surface/bvh.hpp"
#include "surface/winding.hpp"

namespace rlacd {

class Surface {
 public:
  explicit Surface(const Mesh& mesh, int threads = 1) : bvh_(mesh, threads) {}

  const Bvh& bvh() const { return bvh_; }
  const Winding& winding() const {
    return winding_.get([this]() -> const Bvh& { return bvh_; });
  }
  // Whether a closed surface goes around a point.
  bool holds(Vec3 p) const { return winding().of_closed(p) > 0.5; }

 private:
  Bvh bvh_;
  Lazy<Winding> winding_;  // refers to bvh_
};

}  // namespace rlacd
