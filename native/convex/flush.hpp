// Where two convex polytopes lie flush, and what one fills of the other with some of its sides moved outwards.
//
// In:  closed convex triangle meshes, whose flat sides may be cut into many triangles.
// Out: the sides at which one touches the other, with places spread over the contact; the corners of a layer.
// How: triangles of equal normals, up to rounding, are one side: a plane and a polygon. Polygons are clipped by planes.
#pragma once

#include <vector>

#include "convex/polygon.hpp"
#include "core/geometry.hpp"

namespace rlacd {

class FlushBody {
 public:
  explicit FlushBody(Mesh hull);

  struct Contact {
    std::vector<std::int32_t> sides;  // of this body
    std::vector<Vec3> places;         // on the other, moved a little towards the middle of each contact
  };
  // Where a side of another body, turned the other way, lies less deep than `depth` under a side of this one. Sides
  // count as touching up to `touch`.
  Contact contact(const FlushBody& other, double depth, double touch) const;

  // What another body fills of this one with some of its sides, and those nearly parallel to them, moved outwards by
  // `depth`: points whose hull it is; none if it is empty. Planes that the other crosses by at most `touch` are left
  // out.
  std::vector<Vec3> layer(const FlushBody& other, const std::vector<std::int32_t>& sides, double depth,
                          double touch) const;

  // How deep a point lies inside; negative outside.
  double depth(Vec3 point) const;

  std::size_t size() const { return sides_.size(); }

 private:
  struct Side {
    Vec3 normal;    // outwards
    double offset;  // of its plane normal . x = offset
    Polygon polygon;
  };

  Mesh hull_;
  std::vector<Side> sides_;
};

}  // namespace rlacd
