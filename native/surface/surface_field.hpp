// Distance to a surface as a field for branch_and_bound.hpp: the witnesses are the surface's triangles, which are
// convex.
#pragma once

#include "surface/branch_and_bound.hpp"
#include "surface/bvh.hpp"

namespace rlacd {

class SurfaceField {
 public:
  explicit SurfaceField(const Bvh& bvh) : bvh_(bvh) {}

  Sample at(Vec3 p, std::int32_t hint, double enough) const {
    const Bvh::Hit hit = bvh_.closest(p, hint, enough);
    return {std::sqrt(hit.distance2), hit.slot};
  }
  double from(std::int32_t slot, Vec3 p) const { return bvh_.distance(slot, p); }

 private:
  const Bvh& bvh_;
};

}  // namespace rlacd
