// Python binding of candidate planes.

#include "base/arrays.hpp"
#include "cut/concave_edges.hpp"

namespace rlacd {
void bind_concave_edges(nb::module_& m) {
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
