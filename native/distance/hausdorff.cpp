#include "distance/hausdorff.hpp"

#include "distance/surface_field.hpp"

namespace rlacd {

Interval directed_hausdorff(const Mesh& from, const Bvh& to, double tolerance, int threads) {
  return maximize_in_waves(SurfaceField(to), from, tolerance, threads);
}

}  // namespace rlacd
