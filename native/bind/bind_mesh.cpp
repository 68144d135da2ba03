// Python bindings of welding, of the topology of soups and of closed meshes.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <optional>

#include "base/arrays.hpp"
#include "base/stop.hpp"
#include "distance/filling.hpp"
#include "mesh/curve.hpp"
#include "mesh/edges.hpp"
#include "mesh/least_bent.hpp"
#include "mesh/near_boxes.hpp"
#include "mesh/point_tree.hpp"
#include "mesh/spread_points.hpp"
#include "mesh/wedges.hpp"
#include "mesh/weld.hpp"

namespace rlacd {

namespace {

constexpr std::size_t kBetweenPolls = 4096;

using NodesIn = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MarksIn = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;
using WideFacesIn = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

// Copies faces in and checks their indices.
std::vector<Triangle> to_faces(const WideFacesIn& array, std::int64_t vertices) {
  if (vertices < 0 || vertices > std::numeric_limits<std::int32_t>::max() ||
      array.shape(0) > std::numeric_limits<std::int32_t>::max() / 3)
    throw std::invalid_argument("a mesh has at most 2^31 vertices and halfedges");
  std::vector<Triangle> faces(array.shape(0));
  const std::int64_t* corner = array.data();
  for (Triangle& face : faces)
    for (std::int32_t& own : face) {
      if (*corner < 0 || *corner >= vertices) throw std::invalid_argument("face index out of range");
      own = static_cast<std::int32_t>(*corner++);
    }
  return faces;
}

// The same for a mesh whose vertices are only read.
Mesh to_wide_mesh(const PointsIn& vertices, const WideFacesIn& faces) {
  return {to_points(vertices), to_faces(faces, static_cast<std::int64_t>(vertices.shape(0)))};
}

std::vector<bool> to_marks(const std::optional<MarksIn>& array, std::size_t count) {
  if (!array) return {};
  if (array->size() != count) throw std::invalid_argument("not as many marks as items");
  return std::vector<bool>(array->data(), array->data() + count);
}

// Binds what is measured on every face of a mesh, given its corners.
template <class Value, class Measure>
void def_on_faces(nb::module_& m, const char* name, const char* text, const Measure& measure) {
  m.def(
      name,
      [measure](const PointsIn& vertices, const WideFacesIn& faces) {
        const Mesh mesh = to_wide_mesh(vertices, faces);
        std::vector<Value> values(mesh.faces.size());
        for (std::size_t f = 0; f < values.size(); ++f) {
          if (f % kBetweenPolls == 0) poll_stop();
          const auto [a, b, c] = mesh.faces[f];
          values[f] = measure(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
        }
        return rows<double>(std::move(values));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), text);
}

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def(
      "weld",
      [](const PointsIn& vertices, const WideFacesIn& faces) {
        Welded welded = weld(to_wide_mesh(vertices, faces));
        return std::tuple(rows<double>(std::move(welded.mesh.vertices)),
                          rows<std::int32_t>(std::move(welded.mesh.faces)), rows<bool>(std::move(welded.is_film)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "The distinct places of the used vertices, in order of first appearance [U, 3]; the faces [G, 3] with three\n"
      "different corners, and whether they are films [G]. Of faces with the same corners, the first that is wound "
      "like\n"
      "most of them stays; it is a film if as many are wound in either way.");
  m.def(
      "first_in_place",
      [](const PointsIn& array) {
        const std::vector<std::int32_t> found = first_in_place(to_points(array));
        return rows<std::int64_t>(std::vector<std::int64_t>(found.begin(), found.end()));
      },
      Released(), nb::arg("points"),
      "The first of the points [N, 3] at the same place as each [N]; zeros of either sign are equal.");
  m.def(
      "first_of_doubled",
      [](const WideFacesIn& array, std::int64_t vertices) {
        return rows<bool>(first_of_doubled(to_faces(array, vertices), static_cast<std::size_t>(vertices)));
      },
      Released(), nb::arg("faces"), nb::arg("count"),
      "Whether each of the faces [F, 3] over `count` vertices is the first with its three corners, in any order [F].");
  m.def(
      "edges",
      [](const WideFacesIn& array, std::int64_t vertices) {
        Edges found = edges_of(to_faces(array, vertices), static_cast<std::size_t>(vertices));
        return std::tuple(rows<std::int64_t>(std::move(found.of_halfedge)),
                          rows<std::int64_t>(std::move(found.vertices)), rows<std::int64_t>(std::move(found.valence)));
      },
      Released(), nb::arg("faces"), nb::arg("count"),
      "The undirected edges of faces [F, 3]: the edge [3F] of each halfedge, the edges' vertices [E, 2], ascending, "
      "and how\n"
      "many halfedges each has [E].");
  m.def(
      "wedges",
      [](const PointsIn& vertices, const WideFacesIn& faces, const NodesIn& edge_of_halfedge, std::int64_t edges,
         const std::optional<MarksIn>& trusted) {
        const Mesh mesh = to_wide_mesh(vertices, faces);
        const std::vector<std::int64_t> edge(edge_of_halfedge.data(),
                                             edge_of_halfedge.data() + edge_of_halfedge.size());
        if (edge.size() != 3 * mesh.faces.size()) throw std::invalid_argument("every halfedge has an edge");
        for (const std::int64_t e : edge)
          if (e < 0 || e >= edges) throw std::invalid_argument("edge out of range");
        const std::vector<bool> sure = to_marks(trusted, mesh.faces.size());
        Wedges found = wedges_of(mesh, edge, static_cast<std::size_t>(edges), sure);
        return std::tuple(rows<std::int64_t>(std::move(found.halfedges)), rows<std::int64_t>(std::move(found.sides)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("edge_of_halfedge"), nb::arg("edges"),
      nb::arg("trusted") = nb::none(),
      "The wedges of space around the edges: the halfedges [3F, 2] that bound each, going around its edge from its "
      "smaller\n"
      "to its larger vertex by the right-hand rule, and the sides [3F, 2] of their faces that do: 2 f is the front of "
      "face f,\n"
      "2 f + 1 its back. Coincident faces, and trusted ones [F], alternate as their windings require.");
  m.def(
      "least_bent",
      [](const PointsIn& points, const PointsIn& beside, const std::optional<MarksIn>& taken) {
        const std::size_t count = points.shape(0);
        if (count < 3) throw std::invalid_argument("a loop has at least three points");
        if (beside.shape(0) != count) throw std::invalid_argument("not as many normals as points");
        const Loop loop = {to_points(points), to_points(beside), to_marks(taken, count * count)};
        require_finite(loop.points);
        return rows<std::int32_t>(least_bent(loop));
      },
      Released(), nb::arg("points"), nb::arg("beside"), nb::arg("taken") = nb::none(),
      "Triangulates a closed loop [N, 3] with the least bending; [N - 2, 3], wound like the loop. `beside` [N, 3] has "
      "the\n"
      "unit normals of the faces beyond its edges, which run against it; `taken` [N, N] marks pairs of points that "
      "should\n"
      "not get an edge.");
  m.def(
      "components",
      [](std::int64_t count, const NodesIn& a, const NodesIn& b) {
        if (a.shape(0) != b.shape(0)) throw std::invalid_argument("a link has two ends");
        for (const NodesIn* ends : {&a, &b})
          for (std::size_t i = 0; i < ends->shape(0); ++i)
            if ((*ends)(i) < 0 || (*ends)(i) >= count) throw std::invalid_argument("node out of range");
        Groups groups(static_cast<std::size_t>(count));
        for (std::size_t i = 0; i < a.shape(0); ++i) {
          if (i % kBetweenPolls == 0) poll_stop();
          groups.join(a(i), b(i));
        }
        auto [number, labels] = groups.labels();
        return std::tuple(number, rows<std::int64_t>(std::move(labels)));
      },
      Released(), nb::arg("count"), nb::arg("a"), nb::arg("b"),
      "Connected components under links a[i] - b[i]: their number, and the label [count] of each node, by first "
      "nodes.");
  def_on_faces<double>(m, "face_areas", "The area [F] of each face.",
                       [](Vec3 a, Vec3 b, Vec3 c) { return norm(cross(b - a, c - a)) / 2; });
  def_on_faces<Vec3>(m, "long_normals", "The normal [F, 3] of each face, twice as long as its area.",
                     [](Vec3 a, Vec3 b, Vec3 c) { return cross(b - a, c - a); });
  def_on_faces<double>(
      m, "longest_edges", "The length [F] of the longest edge of each face.",
      [](Vec3 a, Vec3 b, Vec3 c) { return std::sqrt(std::max({norm2(b - a), norm2(c - b), norm2(a - c)})); });
  def_on_faces<double>(m, "signed_tetrahedra", "The signed volume [F] between the origin and each face.",
                       [](Vec3 a, Vec3 b, Vec3 c) { return dot(a, cross(b, c)) / 6; });
  m.def(
      "spread_points",
      [](const PointsIn& vertices, const WideFacesIn& faces, double spacing) {
        if (!(spacing > 0)) throw std::invalid_argument("the spacing must be positive");
        SpreadPoints spread = spread_points(to_wide_mesh(vertices, faces), spacing);
        return std::tuple(rows<double>(std::move(spread.points)), rows<std::int32_t>(std::move(spread.faces)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("spacing"),
      "Points [N, 3], corners included, such that no point of a face is farther than `spacing` from one of them, and "
      "the\n"
      "face [N] each lies on, ascending.");
  m.def(
      "mark_cells",
      [](const PointsIn& vertices, const WideFacesIn& faces, double spacing, double pitch, std::int64_t margin) {
        const Mesh mesh = to_wide_mesh(vertices, faces);
        if (mesh.faces.empty()) throw std::invalid_argument("no faces, no cells");
        if (!(spacing > 0 && pitch > 0 && margin >= 0)) throw std::invalid_argument("sizes must be positive");
        MarkedCells cells = mark_cells(mesh, spacing, pitch, margin);
        const Vec3 origin = cells.origin;
        return std::tuple(rows<double>(std::vector{origin.x, origin.y, origin.z}), rows<bool>(std::move(cells.marks)),
                          std::tuple(cells.shape[0], cells.shape[1], cells.shape[2]));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("spacing"), nb::arg("pitch"), nb::arg("margin"),
      "A grid of cells around a mesh: the middle of the first, which of them hold points of faces spread at this\n"
      "spacing, and how many there are along each axis. So many at each end are free.");
  m.def(
      "closed_bodies",
      [](const PointsIn& vertices, const FacesIn& faces) {
        ClosedBodies found = closed_bodies(to_mesh(vertices, faces));
        auto bodies = std::tuple(rows<std::int64_t>(std::move(found.body)), rows<double>(std::move(found.volume)),
                                 rows<double>(std::move(found.area)), rows<double>(std::move(found.box)),
                                 found.has_no_pinch, found.least_height, found.least_fold);
        return found.count == 0 ? std::nullopt : std::optional(std::move(bodies));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "The bodies of a mesh all of whose edges join two faces that run along them in opposite directions, else None:\n"
      "the body [F] of each face; signed volume [B], area [B] and box [B, 6] of each body; whether the faces around "
      "each\n"
      "vertex are all neighbours; the least height of a face, and the least length of the sum of the unit normals "
      "of neighbours.");
  m.def(
      "separate_fans",
      [](const PointsIn& vertices, const FacesIn& faces) { return out(separate_fans(to_mesh(vertices, faces))); },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "A closed mesh in which faces that meet at a vertex only have a vertex each: copies [V', 3] follow the others.");
  m.def(
      "along_a_curve",
      [](const PointsIn& vertices, const FacesIn& faces) { return out(along_a_curve(to_mesh(vertices, faces))); },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "The same mesh with vertices [V, 3] and faces [F, 3] along a space-filling curve: neighbours in space are near "
      "in\n"
      "memory.");
  nb::class_<Boxes>(m, "Boxes", "The boxes of hulls under numbers.")
      .def(
          "__init__",
          [](Boxes* self, const std::vector<const HullCorners*>& hulls, const std::vector<std::int32_t>& numbers) {
            if (!numbers.empty() && numbers.size() != hulls.size()) throw std::invalid_argument("one number a hull");
            new (self) Boxes();
            for (std::size_t i = 0; i < hulls.size(); ++i)
              self->add(numbers.empty() ? static_cast<std::int32_t>(i) : numbers[i], hulls[i]->box);
          },
          nb::arg("hulls"), nb::arg("numbers") = std::vector<std::int32_t>(),
          "Without numbers, which have to ascend, hulls are numbered from 0.")
      .def("__len__", &Boxes::size)
      .def(
          "add", [](Boxes& self, std::int32_t number, const HullCorners& hull) { self.add(number, hull.box); },
          nb::arg("number"), nb::arg("hull"), "Add the box of a hull; its number is larger than all before.")
      .def("without", &Boxes::without, nb::arg("gone"), "All boxes but those of some numbers.")
      .def(
          "pairs",
          [](const Boxes& self, const std::vector<std::int32_t>& fresh, double reach, bool across) {
            return rows<std::int32_t>(self.pairs(fresh, reach, across));
          },
          Released(), nb::arg("fresh"), nb::arg("reach"), nb::arg("across") = false,
          "Pairs [P, 2] of numbers, ascending, of a fresh box and any other: those within reach of each other, or "
          "with\n"
          "`across` of a common third one.");
  nb::class_<PointTree>(m, "PointTree", "Finds those of some points [N, 3] that lie in a ball.")
      .def(
          "__init__",
          [](PointTree* self, const PointsIn& array) {
            std::vector<Vec3> points = to_points(array);
            require_finite(points);
            new (self) PointTree(std::move(points));
          },
          Released(), nb::arg("points"))
      .def(
          "within",
          [](const PointTree& self, const PointsIn& array, const VectorIn& radii, std::size_t most) {
            const std::vector<Vec3> centres = to_points(array);
            require_finite(centres);
            if (radii.shape(0) != centres.size()) throw std::invalid_argument("one radius a centre");
            std::vector<std::int64_t> counts(centres.size());
            std::vector<std::int32_t> found;
            for (std::size_t i = 0; i < centres.size() && found.size() <= most; ++i) {
              if (i % kBetweenPolls == 0) poll_stop();
              const std::size_t before = found.size();
              self.within(centres[i], radii(i), found);
              counts[i] = static_cast<std::int64_t>(found.size() - before);
            }
            return std::tuple(rows<std::int64_t>(std::move(counts)), rows<std::int32_t>(std::move(found)));
          },
          Released(), nb::arg("centres"), nb::arg("radii"), nb::arg("most") = std::numeric_limits<std::size_t>::max(),
          "How many points [M] are at most radii [M] away from each centre [M, 3]; their indices, one centre after "
          "the\n"
          "other, ascending. The search ends once more than `most` are found.");
}

}  // namespace rlacd
