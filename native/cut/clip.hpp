// Convex polygons in space, cut by planes: what is left of a polygon outside a convex polytope.
#pragma once

#include <utility>
#include <vector>

#include "base/geometry.hpp"
#include "hull/convex_planes.hpp"

namespace rlacd {

using Polygon = std::vector<Vec3>;  // convex and flat

// Corners this close to a plane lie on it: a cut leaves no polygon thinner than rounding.
constexpr double kOnPlane = 1e-12;

// The facet planes of a convex polytope, each moved along its normal: the points with n_i . x <= offset_i for all i.
struct HalfSpaces {
  explicit HalfSpaces(const ConvexPlanes& facets) : planes(&facets), offset(facets.offsets()) {}

  const ConvexPlanes* planes;
  std::vector<double> offset;  // padded as the planes are
};

// Remembers nothing but its memory, which many small polygons would otherwise ask for again and again.
class Clipper {
 public:
  // Replaces every polygon by what is left of it outside the intersection of half-spaces. One that does not meet the
  // intersection stays whole.
  void subtract(std::vector<Polygon>& polygons, const HalfSpaces& convex);

 private:
  // Whether one of the half-spaces alone shows that a polygon does not reach inside all of them; else, the planes that
  // it reaches beyond are kept in `crossed_`.
  bool is_separated(const Polygon& polygon, const HalfSpaces& convex);
  void split(const Polygon& polygon, Vec3 normal, double offset);

  std::vector<std::int32_t> crossed_;
  std::vector<Polygon> left_, cut_off_;
  Polygon rest_, inside_, outside_;
};

}  // namespace rlacd
