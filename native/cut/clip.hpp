// Convex polygons in space, clipped by planes: the part of a polygon outside a convex polytope.
#pragma once

#include <utility>
#include <vector>

#include "base/geometry.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {

using Polygon = std::vector<Vec3>;  // convex and flat

// Corners this close to a plane count as on it: no clipped polygon is thinner than rounding.
constexpr double kOnPlane = 1e-12;

// The facet planes of a convex polytope, each offset along its normal: the points with n_i . x <= offset_i for all i.
struct HalfSpaces {
  explicit HalfSpaces(const ConvexPlanes& facets) : planes(&facets), offset(facets.offsets()) {}

  const ConvexPlanes* planes;
  std::vector<double> offset;  // padded like the planes
};

// Keeps only its buffers between calls: many small polygons would otherwise allocate them again and again.
class Clipper {
 public:
  // Replaces every polygon by its part outside the intersection of half-spaces. A polygon that does not meet the
  // intersection stays whole.
  void subtract(std::vector<Polygon>& polygons, const HalfSpaces& convex);

 private:
  // Whether a single half-space shows that a polygon does not reach into the intersection; if not, the planes that the
  // polygon crosses are stored in `crossed_`.
  bool is_separated(const Polygon& polygon, const HalfSpaces& convex);
  void split(const Polygon& polygon, Vec3 normal, double offset);

  std::vector<std::int32_t> crossed_;
  std::vector<Polygon> left_, cut_off_;
  Polygon rest_, inside_, outside_;
};

}  // namespace rlacd
