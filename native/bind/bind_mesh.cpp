// Python bindings of welding, of the topology of soups and of closed meshes, and of what is measured on meshes.
#include <cmath>

#include "bind/released.hpp"
#include "convex/convex_body.hpp"
#include "core/mesh_measures.hpp"
#include "core/stop.hpp"
#include "decompose/simplifier.hpp"
#include "surface/bvh.hpp"
#include "surface/crossings.hpp"
#include "surface/curve.hpp"
#include "surface/edges.hpp"
#include "surface/least_bent.hpp"
#include "surface/near_boxes.hpp"
#include "surface/spread_points.hpp"
#include "surface/weld.hpp"

namespace rlacd {

auto parts(Edges& own) { return std::tie(own.of_halfedge, own.vertices, own.valence); }
auto parts(Wedges& own) { return std::tie(own.halfedges, own.sides); }
auto parts(SpreadPoints& own) { return std::tie(own.points, own.faces); }
auto parts(Crossings& own) { return std::tie(own.pairs, own.corners); }
auto parts(Welded& own) { return std::tie(own.mesh.vertices, own.mesh.faces, own.is_film); }
auto parts(MarkedCells& own) { return std::tie(own.origin, own.marks, own.shape); }
auto parts(Mass& own) { return std::tie(own.volume, own.centre, own.inertia); }
auto parts(ClosedBodies& own) {
  return std::tie(own.body, own.volume, own.area, own.box, own.has_no_pinch, own.least_height, own.least_fold);
}

namespace {

using NodesIn = VectorIn<std::int64_t>;
using MarksIn = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;

std::vector<bool> to_marks(const std::optional<MarksIn>& array, std::size_t count) {
  if (!array) return {};
  require(array->size() == count, "not as many marks as items");
  return std::vector<bool>(array->data(), array->data() + count);
}

template <class Grid>
Cell shape_of(const Grid& grid) {
  return {static_cast<std::int64_t>(grid.shape(0)), static_cast<std::int64_t>(grid.shape(1)),
          static_cast<std::int64_t>(grid.shape(2))};
}

// Binds what is measured on every face of a mesh, given its corners.
template <class Measure>
void def_on_faces(nb::module_& m, const char* name, const char* text, const Measure& measure) {
  const auto kernel = [measure](const WideMesh& mesh) {
    std::vector<decltype(measure(Corners()))> values(mesh.faces.size());
    for (std::size_t f = 0; f < values.size(); ++f) {
      poll_stop(f);
      values[f] = measure(corners_of(mesh, mesh.faces[f]));
    }
    return values;
  };
  m.def(name, released(kernel), "vertices"_a, "faces"_a, text);
}

Wedges wedges(const WideMesh& mesh, const NodesIn& edge_of_halfedge, std::int64_t edges,
              const std::optional<MarksIn>& trusted) {
  const auto edge = copied<std::int64_t>(edge_of_halfedge);
  require(edge.size() == 3 * mesh.faces.size(), "every halfedge has an edge");
  for (const std::int64_t e : edge) require(e >= 0 && e < edges, "edge out of range");
  return wedges_of(mesh, edge, static_cast<std::size_t>(edges), to_marks(trusted, mesh.faces.size()));
}

std::pair<std::int64_t, std::vector<std::int64_t>> components(std::int64_t count, const NodesIn& a, const NodesIn& b) {
  require(a.shape(0) == b.shape(0), "a link has two ends");
  Groups groups(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < a.shape(0); ++i) {
    poll_stop(i);
    for (const std::int64_t end : {a(i), b(i)}) require(end >= 0 && end < count, "node out of range");
    groups.join(a(i), b(i));
  }
  return groups.labels();
}

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def("weld", released([](const WideMesh& mesh) { return weld(mesh); }), "vertices"_a, "faces"_a,
        "The distinct places of the used vertices, in order of first appearance [U, 3]; the faces [G, 3] with three "
        "different corners, and whether they are films [G]. Of faces with the same corners, the first that is wound "
        "like most of them stays; it is a film if as many are wound in either way.");
  m.def("first_in_place", released([](const PointsIn& points) {
          const std::vector<std::int32_t> found = first_in_place(copied<Vec3>(points));
          return std::vector<std::int64_t>(found.begin(), found.end());
        }),
        "points"_a, "The first of the points [N, 3] at the same place as each [N]; zeros of either sign are equal.");
  m.def(
      "first_of_doubled", released([](const WideFacesIn& faces, std::int64_t count) {
        return first_of_doubled(to_faces(faces, count), static_cast<std::size_t>(count));
      }),
      "faces"_a, "count"_a,
      "Whether each of the faces [F, 3] over `count` vertices is the first with its three corners, in any order [F].");
  m.def("edges", released([](const WideFacesIn& faces, std::int64_t count) {
          return edges_of(to_faces(faces, count), static_cast<std::size_t>(count));
        }),
        "faces"_a, "count"_a,
        "The undirected edges of faces [F, 3]: the edge [3F] of each halfedge, the edges' vertices [E, 2], ascending, "
        "and how many halfedges each has [E].");
  m.def("wedges", released(wedges), "vertices"_a, "faces"_a, "edge_of_halfedge"_a, "edges"_a, "trusted"_a = nb::none(),
        "The wedges of space around the edges: the halfedges [3F, 2] that bound each, going around its edge from its "
        "smaller to its larger vertex by the right-hand rule, and the sides [3F, 2] of their faces that do: 2 f is the "
        "front of face f, 2 f + 1 its back. Coincident faces, and trusted ones [F], alternate as their windings "
        "require.");
  m.def("least_bent",
        released([](const std::vector<Vec3>& points, const PointsIn& beside, const std::optional<MarksIn>& taken) {
          require(points.size() >= 3, "a loop has at least three points");
          require(beside.shape(0) == points.size(), "not as many normals as points");
          return least_bent({points, copied<Vec3>(beside), to_marks(taken, points.size() * points.size())});
        }),
        "points"_a, "beside"_a, "taken"_a = nb::none(),
        "Triangulates a closed loop [N, 3] with the least bending; [N - 2, 3], wound like the loop. `beside` [N, 3] "
        "has the unit normals of the faces beyond its edges, which run against it; `taken` [N, N] marks pairs of "
        "points that should not get an edge.");
  m.def("components", released(components), "count"_a, "a"_a, "b"_a,
        "Connected components under links a[i] - b[i]: their number, and the label [count] of each node, by first "
        "nodes.");
  def_on_faces(m, "face_areas", "The area [F] of each face.",
               [](const Corners& t) { return norm(long_normal(t)) / 2; });
  def_on_faces(m, "long_normals", "The normal [F, 3] of each face, twice as long as its area.",
               [](const Corners& t) { return long_normal(t); });
  def_on_faces(m, "longest_edges", "The length [F] of the longest edge of each face.", [](const Corners& t) {
    return std::sqrt(std::max({norm2(t[1] - t[0]), norm2(t[2] - t[1]), norm2(t[0] - t[2])}));
  });
  def_on_faces(m, "signed_tetrahedra", "The signed volume [F] between the origin and each face.",
               [](const Corners& t) { return dot(t[0], cross(t[1], t[2])) / 6; });
  m.def("spread_points", released([](const WideMesh& mesh, double spacing) {
          require(spacing > 0, "the spacing must be positive");
          return spread_points(mesh, spacing);
        }),
        "vertices"_a, "faces"_a, "spacing"_a,
        "Points [N, 3], corners included, such that no point of a face is farther than `spacing` from one of them, and "
        "the face [N] each lies on, ascending.");
  m.def("mark_cells", released([](const WideMesh& mesh, double spacing, double pitch, std::int64_t margin) {
          require(!mesh.faces.empty(), "no faces, no cells");
          require(spacing > 0 && pitch > 0 && margin >= 0, "sizes must be positive");
          return mark_cells(mesh, spacing, pitch, margin);
        }),
        "vertices"_a, "faces"_a, "spacing"_a, "pitch"_a, "margin"_a,
        "A grid of cells around a mesh: the middle of the first, which of them hold points of faces spread at this "
        "spacing, and how many there are along each axis. So many at each end are free.");
  m.def("label_cells",
        released([](const ArrayIn<bool, nb::ndim<3>>& marks) { return label_cells(marks.data(), shape_of(marks)); }),
        "marks"_a,
        "Labels [X * Y * Z] of the connected sets of marked cells [X, Y, Z], which share sides, ascending by their "
        "first cells; 0 for all other cells.");
  m.def("nearest_labels",
        released([](const ArrayIn<std::int64_t, nb::ndim<3>>& labels,
                    const ArrayIn<std::int64_t, nb::shape<-1, 3>>& cells, double reach) {
          const Cell shape = shape_of(labels);
          const std::vector<Cell> places = copied<Cell>(cells);
          for (const Cell& cell : places)
            for (std::size_t axis = 0; axis < 3; ++axis)
              require(cell[axis] >= 0 && cell[axis] < shape[axis], "a cell off the grid");
          require(reach >= 0 && reach < 1000, "the reach has to be from 0 to 1000 cells");
          return nearest_labels(labels.data(), shape, places, reach);
        }),
        "labels"_a, "cells"_a, "reach"_a,
        "The label [N] of the nearest labelled cell of a grid [X, Y, Z] at most `reach` cells away from each cell [N, "
        "3]; 0 where there is none.");
  m.def("closed_bodies", released([](const AnyMesh& mesh) { return closed_bodies(mesh); }), "vertices"_a, "faces"_a,
        "The bodies of a mesh all of whose edges join two faces that run along them in opposite directions, else None: "
        "the body [F] of each face; signed volume [B], area [B] and box [B, 6] of each body; whether the faces around "
        "each vertex are all neighbours; the least height of a face, and the least length of the sum of the unit "
        "normals of neighbours.");
  m.def("along_a_curve", released([](const AnyMesh& mesh) { return along_a_curve(mesh); }), "vertices"_a, "faces"_a,
        "The same mesh with vertices [V, 3] and faces [F, 3] along a space-filling curve: neighbours in space are near "
        "in memory.");
  m.def("mesh_volume", released([](const AnyMesh& mesh) { return mesh_volume(mesh); }), "vertices"_a, "faces"_a,
        "Signed volume of a closed triangle mesh.");
  m.def("mesh_area", released([](const AnyMesh& mesh) { return mesh_area(mesh); }), "vertices"_a, "faces"_a,
        "Area of a triangle mesh.");
  m.def("principal_axes", released([](const AnyMesh& mesh) { return principal_axes(mesh); }), "vertices"_a, "faces"_a,
        "Principal axes [3, 3] of a surface, one per row, longest first, the largest entry of each positive.");
  m.def("principal_axes_of_points", released([](const std::vector<Vec3>& points) { return principal_axes(points); }),
        "points"_a, "Principal axes [3, 3] of points [N, 3], likewise.");
  m.def("mesh_mass", released([](const AnyMesh& mesh) { return mesh_mass(mesh); }), "vertices"_a, "faces"_a,
        "Volume, centre of mass, and inertia about it [3, 3] of the solid of density one in a closed mesh.");
  m.def("sample_surface", released(sample_surface), "vertices"_a, "faces"_a, "count"_a, "seed"_a,
        "Points [count, 3] spread evenly by area over a surface, and their faces [count]; the same bits for a seed.");
  m.def("crossings", released([](const Mesh& mesh, const NodesIn& body, std::int64_t most) {
          require(body.shape(0) == mesh.faces.size(), "one body for every face");
          return mesh.faces.empty() ? Crossings() : crossings(mesh, copied<std::int64_t>(body), most);
        }),
        "vertices"_a, "faces"_a, "body"_a, "most"_a,
        "How many pairs of faces of different bodies [F] touch, and a bound on the corners of their arrangement. Stops "
        "to count once there are more than `most` pairs.");
  m.def(
      "points_within",
      released([](const std::vector<Vec3>& points, const std::vector<Vec3>& centres, const VectorIn<double>& radii,
                  std::size_t most) {
        require(radii.shape(0) == centres.size(), "one radius a centre");
        return points_within(points, centres, copied<double>(radii), most);
      }),
      "points"_a, "centres"_a, "radii"_a, "most"_a = std::numeric_limits<std::size_t>::max(),
      "How many points [N, 3] are at most radii [M] away from each centre [M, 3]; their indices, one centre after the "
      "other, ascending. The search ends once more than `most` are found.");

  nb::class_<Boxes>(m, "Boxes", "The boxes of hulls under numbers.")
      .def(
          "__init__",
          [](Boxes* self, const std::vector<const ConvexBody*>& hulls) {
            new (self) Boxes();
            for (const ConvexBody* hull : hulls) self->add(static_cast<std::int32_t>(self->size()), hull->box());
          },
          "hulls"_a, "Hulls are numbered from 0.")
      .def(
          "add", [](Boxes& self, std::int32_t number, const ConvexBody& hull) { self.add(number, hull.box()); },
          "number"_a, "hull"_a, "Add the box of a hull; its number is larger than all before.")
      .def("without", &Boxes::without, "gone"_a, "All boxes but those of some numbers.")
      .def(
          "pairs", released(&Boxes::pairs), "fresh"_a, "reach"_a, "across"_a = false,
          "Pairs [P, 2] of numbers, ascending, of a fresh box and any other: those within reach of each other, or with "
          "`across` of a common third one.");
  nb::class_<Simplifier>(m, "Simplifier", "A closed, oriented manifold mesh that gets fewer and fewer triangles.")
      .def("__init__", released([](Simplifier* self, const Mesh& mesh) { new (self) Simplifier(mesh); }), "vertices"_a,
           "faces"_a)
      .def("reduce", &Simplifier::reduce, nb::call_guard<nb::gil_scoped_release>(), "count"_a, "threads"_a = 1,
           "Collapse edges until at most `count` triangles are left, or hardly any edge can be collapsed.")
      .def("mesh", released(&Simplifier::mesh), "The vertices [V, 3] and faces [F, 3] reached.");
}

}  // namespace rlacd
