// Python bindings of concave edges and their planes.

#include "base/arrays.hpp"
#include "cut/concave_edges.hpp"

namespace rlacd {
namespace {

auto to_rows(const std::vector<ReflexEdge>& edges) {
  std::vector<std::array<std::int32_t, 2>> ends, faces;
  std::vector<std::array<Vec3, 2>> normals;
  std::vector<double> angles;
  for (const ReflexEdge& edge : edges) {
    ends.push_back({edge.end[0], edge.end[1]});
    faces.push_back({edge.face[0], edge.face[1]});
    normals.push_back({edge.normal[0], edge.normal[1]});
    angles.push_back(edge.angle);
  }
  return std::tuple(rows<std::int32_t>(std::move(ends)), rows<std::int32_t>(std::move(faces)),
                    rows<double>(std::move(normals)), rows<double>(std::move(angles)));
}

}  // namespace

void bind_concave_edges(nb::module_& m) {
  m.def(
      "reflex_edges",
      [](const PointsIn& vertices, const FacesIn& faces) {
        const Mesh mesh = to_mesh(vertices, faces);
        std::vector<ReflexEdge> edges = reflex_edges(mesh);
        return to_rows(edges);
      },
      Released(), nb::arg("vertices"), nb::arg("faces"),
      "Edges whose dihedral angle exceeds a straight one by more than 10 degrees: (vertices [E, 2], the faces on both\n"
      "sides [E, 2], their outward unit normals [E, 6], by how much the angle exceeds a straight one [E]).");
  m.def(
      "concave_edges",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& hull_vertices, const FacesIn& hull_faces,
         std::size_t count) {
        const Mesh mesh = to_mesh(vertices, faces), hull = to_mesh(hull_vertices, hull_faces);
        std::vector<ReflexEdge> edges = choose_concave_edges(mesh, hull, count);
        return to_rows(edges);
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("hull_vertices"), nb::arg("hull_faces"),
      nb::arg("count"),
      "Up to `count` of the reflex edges, deep, sharp ones of long creases first, and spread out; as `reflex_edges`.");
  m.def(
      "candidate_planes",
      [](const PointsIn& vertices, const FacesIn& faces, const PointsIn& hull_vertices, const FacesIn& hull_faces,
         int per_axis, std::size_t edges) {
        const Mesh mesh = to_mesh(vertices, faces), hull = to_mesh(hull_vertices, hull_faces);
        std::vector<CandidatePlane> planes;
        if (per_axis > 0) planes = equidistant_planes(mesh, hull, per_axis);
        if (edges > 0)
          for (const CandidatePlane& plane : planes_of_edges(mesh, hull, choose_concave_edges(mesh, hull, edges)))
            planes.push_back(plane);
        std::vector<Vec3> normals;
        std::vector<double> offsets;
        for (const CandidatePlane& plane : planes) {
          normals.push_back(plane.normal);
          offsets.push_back(plane.offset);
        }
        return std::tuple(rows<double>(std::move(normals)), rows<double>(std::move(offsets)));
      },
      Released(), nb::arg("vertices"), nb::arg("faces"), nb::arg("hull_vertices"), nb::arg("hull_faces"),
      nb::arg("per_axis"), nb::arg("edges"),
      "Unit normals [K, 3] and offsets [K] of planes: `per_axis` along each coordinate axis and principal axis,\n"
      "which divide the hull's extent into equal slabs, and at most three for each of the concave edges chosen.");
}

}  // namespace rlacd
