// The facet planes of a convex polytope in a vectorised layout, and depth under them.
//
// In:  a closed convex triangle mesh, whose facets may be slivers and whose flat sides may be cut into many triangles.
// Out: unit normals n_i and offsets h_i with n_i . x <= h_i for every corner x, one plane per flat side.
// A sliver's computed normal can point anywhere. Every plane is therefore pushed out until it touches the hull's
// farthest corner: it then supports the hull whatever its normal, and the distance from an inner point to it is never
// less than the distance to the hull's surface. Thin hulls get supporting planes around their rims and ends as well:
// the planes of their facets alone hold points far beyond them.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "core/geometry.hpp"

// Functions that are compiled twice: for every processor, and with wider registers for those that have them. The choice
// is made when the library is loaded. Both give the same bits: no operations are fused.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which are not there yet when it is decided
#define RLACD_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define RLACD_WIDE
#endif

namespace rlacd {

class ConvexPlanes {
 public:
  // The arrays are padded to whole blocks with planes infinitely far away.
  static constexpr std::size_t kBlock = 16;

  explicit ConvexPlanes(const Mesh& hull);

  std::size_t size() const { return count_; }
  Vec3 normal(std::int32_t i) const { return {x_[i], y_[i], z_[i]}; }
  double offset(std::int32_t i) const { return h_[i]; }
  const double* x() const { return x_.data(); }  // of all normals
  const double* y() const { return y_.data(); }
  const double* z() const { return z_.data(); }
  const std::vector<double>& offsets() const { return h_; }

  // Distance from p to plane i, positive inside.
  double depth(std::int32_t i, Vec3 p) const { return h_[i] - (x_[i] * p.x + y_[i] * p.y + z_[i] * p.z); }

  struct Nearest {
    double depth = kInfinity;
    std::int32_t plane = -1;
  };
  // The plane of least depth: for a point inside the hull, the distance to its surface; negative outside.
  Nearest nearest(Vec3 p) const;
  // A plane that p is at most t deep under, or -1.
  std::int32_t first_within(Vec3 p, double t) const;

 private:
  std::size_t count_ = 0;
  std::vector<double> x_, y_, z_, h_;
};

}  // namespace rlacd
