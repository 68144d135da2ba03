#include <doctest/doctest.h>

#include "convex/hull.hpp"
#include "core/mesh_measures.hpp"
#include "shapes.hpp"
#include "solid/against.hpp"
#include "solid/pieces.hpp"
#include "solid/reunite.hpp"

using namespace rlacd;

TEST_CASE("a cut closes both sides and loses no volume; the sides reunite to the solid") {
  Random random(9);
  for (const Mesh& solid : {box({1, 0.5, 0.7}), torus(0.7, 0.3), torus(0.7, 0.3, 61, 7)})
    for (int i = 0; i < 40; ++i) {
      const Plane plane =  // the first along the mesh's own edges
          i < 4 ? Plane{{0, i % 2 == 0 ? 1.0 : 0.0, i % 2 == 0 ? 0.0 : 1.0}, i < 2 ? 0 : 0.1}
                : Plane{normalized(random.point(1)), random(-0.4, 0.4)};
      const auto sides = cut(solid, plane.normal, plane.offset, 0);
      REQUIRE((sides[0] && sides[1]));
      CHECK(sides[0]->volume + sides[1]->volume == doctest::Approx(mesh_volume(solid)).epsilon(1e-9));
      for (int side = 0; side < 2; ++side) {
        CHECK(is_closed(sides[side]->mesh));
        CHECK(sides[side]->hull_volume >= sides[side]->volume * (1 - 1e-9));
        for (const Vec3 p : sides[side]->mesh.vertices) CHECK((side == 0 ? 1 : -1) * plane.depth(p) > -1e-9);
      }
      const auto whole = reunited({sides[0]->mesh, sides[1]->mesh});
      REQUIRE(whole);
      CHECK(is_closed(*whole));
      CHECK(mesh_volume(*whole) == doctest::Approx(mesh_volume(solid)).epsilon(1e-9));
    }
}

TEST_CASE("beside the axis of a torus a cut leaves two pieces") {
  const auto sides = cut(torus(0.7, 0.3), {1, 0, 0}, 0.1, 0);
  const auto pieces = connected_pieces(cut(sides[1]->mesh, {1, 0, 0}, 0.3, 0)[0]->mesh, 0);
  REQUIRE((pieces && pieces->size() == 2));
  CHECK((*pieces)[0].volume == doctest::Approx((*pieces)[1].volume));
}

TEST_CASE("what a solid fills of a convex hull is what is left by cuts along its facets") {
  Random random(10);
  const Mesh solid = torus(0.7, 0.3);
  const Against against(solid);
  for (int i = 0; i < 40; ++i) {
    std::vector<Vec3> points;
    for (int n = 0; n < 12; ++n) points.push_back(random.point(1));
    const ConvexBody hull(hull_mesh(points));
    CHECK(against.filled(hull) == doctest::Approx(mesh_volume(against.inside(hull))).epsilon(1e-6));
  }
}

TEST_CASE("a hull meets what is measured of it, and no less") {
  Random random(11);
  const Against against(torus(0.7, 0.3));
  for (int i = 0; i < 40; ++i) {
    std::vector<Vec3> points;
    for (int n = 0; n < 12; ++n) points.push_back(random.point(1));
    const ConvexBody hull(hull_mesh(points));
    const Against::Fit fit = against.measure(hull, 1e-4, 0);
    CHECK(fit.depth.lower <= fit.depth.upper);
    CHECK(fit.reach.lower <= fit.reach.upper);
    CHECK_FALSE(against.comes_deeper(hull, 1.01 * fit.depth.upper + 1e-4));
    CHECK_FALSE(against.leads_farther(hull, 1.01 * fit.reach.upper + 1e-4));
    if (fit.depth.lower > 0) CHECK(against.comes_deeper(hull, 0.99 * fit.depth.lower));
    if (fit.reach.lower > 0) CHECK(against.leads_farther(hull, 0.99 * fit.reach.lower));
  }
}
