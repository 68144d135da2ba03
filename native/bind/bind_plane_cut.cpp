// Python bindings of plane cuts and of the pieces they leave.
#include "base/arrays.hpp"
#include "cut/bodies.hpp"
#include "cut/plane_cut.hpp"

namespace rlacd {

namespace {

nb::tuple as_tuple(Mesh&& mesh) {
  return nb::make_tuple(to_array<double>(std::move(mesh.vertices)), to_array<std::int32_t>(std::move(mesh.faces)));
}

nb::tuple as_tuple(OpenSide&& side, Vec3 outward) {
  nb::list rims, outlines;
  for (std::vector<std::int32_t>& rim : side.rims) {
    std::vector<Vec3> points;
    for (const std::int32_t i : rim) points.push_back(side.mesh.vertices[i]);
    outlines.append(to_array<double>(on_plane(points, outward)));
    rims.append(to_array<std::int32_t>(std::move(rim)));
  }
  return nb::make_tuple(to_array<double>(std::move(side.mesh.vertices)),
                        to_array<std::int32_t>(std::move(side.mesh.faces)), rims, outlines);
}

}  // namespace

void bind_plane_cut(nb::module_& m) {
  m.def(
      "cut_by_plane",
      [](const PointsIn& vertices, const FacesIn& faces, double x, double y, double z, double offset) {
        const Mesh mesh = to_finite_mesh(vertices, faces);
        const Vec3 normal = {x, y, z};
        std::array<OpenSide, 2> sides;
        {
          nb::gil_scoped_release release;
          sides = cut_by_plane(mesh, normal, offset);
        }
        return nb::make_tuple(as_tuple(std::move(sides[0]), normal), as_tuple(std::move(sides[1]), -normal));
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("x"), nb::arg("y"), nb::arg("z"), nb::arg("offset"),
      "What lies below and above a plane of a closed mesh, without the cap in the plane: for each side vertices [V, "
      "3],\n"
      "faces [F, 3], the cap's rims as loops of vertices, a list of [R], and as points [R, 2] of the plane, counter-\n"
      "clockwise from outside.");
  m.def(
      "bodies",
      [](const PointsIn& vertices, const FacesIn& faces) {
        const Mesh mesh = to_finite_mesh(vertices, faces);
        std::vector<Mesh> found;
        {
          nb::gil_scoped_release release;
          found = bodies(mesh);
        }
        nb::list all;
        for (Mesh& one : found) all.append(as_tuple(std::move(one)));
        return all;
      },
      nb::arg("vertices"), nb::arg("faces"),
      "The edge-connected pieces of a mesh, each with its own vertices: a list of (vertices, faces).");
}

}  // namespace rlacd
