// Convex hull of points: quickhull on exact predicates, growable by further batches of points.
//
// Input:  points in any number, order and degeneracy (duplicate, coplanar, cocircular).
// Output: a closed triangle mesh, outward oriented, with its corners in exactly convex position: no input point lies
//         strictly above any facet's plane, decided without rounding.
// Algorithm: Barber, Dobkin, Huhdanpaa, "The Quickhull Algorithm for Convex Hulls" (1996). The side of a facet on which
// a point lies is read from the facet's floating-point plane where an a-priori error bound allows it, and from exact
// arithmetic elsewhere. A point on a facet's plane does not see it; since exact signs make the facets that a point sees
// a topological disk, the horizon is one simple loop and no new triangle is degenerate.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "convex/facets.hpp"
#include "core/geometry.hpp"

namespace rlacd {

struct HullFacet {
  Vec3 normal;           // (b - a) x (c - a), not normalised
  Vec3 origin;           // corner a
  double offset;         // of the plane, normal . a
  double error;          // |computed height - exact height| <= error * max_abs(p - a)
  std::int32_t outside;  // first point of the list that this facet is responsible for, -1 when none
};

class HullBuilder : Facets<HullFacet> {
 public:
  // Points up to about `tolerance` outside the current hull may be dropped, unless the hull is flat; 0 gives the exact
  // hull. Decisions about the points that are added stay exact.
  explicit HullBuilder(double tolerance = 0) : tolerance_(tolerance) {}

  // Extends the hull by a batch of points. Earlier points keep their numbers, in the order they were added.
  void add(const std::vector<Vec3>& points);

  // Drops the points that are not corners, once there are facets; the others are renumbered.
  void drop_inner_points();

  // Dimension of the points' affine hull: -1 (none), 0 (one point), 1 (a line), 2 (a plane), 3. Facets exist for 3.
  int rank() const { return rank_; }
  double volume() const;
  double area() const;
  const std::vector<Vec3>& points() const { return points_; }
  const Box& extent() const { return extent_; }  // of all points
  std::vector<Triangle> triangles() const;
  std::vector<std::int32_t> extreme_corners() const;  // those not inside a facet or an edge of the polytope (rank 3)

 private:
  double height(const Facet& f, Vec3 p) const { return dot(f.normal, p - f.origin); }
  bool sees(const Facet& f, Vec3 p) const;
  bool sees_closely(const Facet& f, Vec3 p) const;
  bool initialise();
  std::int32_t new_facet(std::int32_t a, std::int32_t b, std::int32_t c);
  template <class Sees>
  void assign(std::int32_t point, const std::vector<std::int32_t>& facets, const Sees& sees);
  void expand(std::vector<std::int32_t>& pending);
  void insert(std::int32_t point, std::int32_t facet, std::vector<std::int32_t>& pending);

  double tolerance_;
  int rank_ = -1;
  std::vector<Vec3> points_;
  std::vector<std::int32_t> next_outside_;  // linked lists of outside points, by point
  Box extent_;
  double reach_ = 0;  // four times the largest coordinate
  std::vector<std::int32_t> orphans_;
};

struct Hull {
  std::vector<std::int32_t> indices;  // into the input points, ascending
  std::vector<Triangle> faces;        // into `indices`
  int rank = -1;
};

// The hull with every corner an extreme point: points inside a facet or an edge are left out.
Hull convex_hull(const std::vector<Vec3>& points);

// The same as a mesh; empty if the points are coplanar.
Mesh hull_mesh(const std::vector<Vec3>& points);

// What of a convex hull lies below a plane; empty if that is flat.
Mesh hull_below(const Mesh& hull, const Plane& plane);

}  // namespace rlacd
