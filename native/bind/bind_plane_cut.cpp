// Python bindings of plane cuts and of the pieces they leave.
#include <nanobind/stl/vector.h>

#include "base/arrays.hpp"
#include "base/mesh_measures.hpp"
#include "cut/bodies.hpp"
#include "cut/plane_cut.hpp"
#include "cut/uncross.hpp"

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

using RimsIn = std::vector<nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>>;
using OutlineIn = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using OutlinesIn = std::vector<OutlineIn>;

std::vector<std::vector<std::int32_t>> to_rims(const RimsIn& arrays, std::size_t vertices) {
  std::vector<std::vector<std::int32_t>> rims;
  for (const auto& array : arrays) {
    rims.emplace_back(array.data(), array.data() + array.shape(0));
    for (const std::int32_t i : rims.back())
      if (i < 0 || static_cast<std::size_t>(i) >= vertices) throw std::invalid_argument("rim index out of range");
  }
  return rims;
}

std::vector<PlanePoint> to_plane_points(const OutlineIn& array) {
  std::vector<PlanePoint> points(array.shape(0));
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {array(i, 0), array(i, 1)};
  return points;
}

std::vector<std::vector<PlanePoint>> to_outlines(const OutlinesIn& arrays,
                                                 const std::vector<std::vector<std::int32_t>>& rims) {
  std::vector<std::vector<PlanePoint>> outlines;
  for (const auto& array : arrays) outlines.push_back(to_plane_points(array));
  if (outlines.size() != rims.size()) throw std::invalid_argument("as many outlines as rims are needed");
  for (std::size_t r = 0; r < rims.size(); ++r)
    if (outlines[r].size() != rims[r].size()) throw std::invalid_argument("an outline has as many points as its rim");
  return outlines;
}

nb::tuple as_tuple(UncrossedSide&& side) {
  nb::list regions;
  for (RimRegion& region : side.regions) {
    nb::list rims, outlines;
    for (auto& rim : region.rims) rims.append(to_array<std::int32_t>(std::move(rim)));
    for (auto& outline : region.outlines) outlines.append(to_array<double>(std::move(outline)));
    regions.append(nb::make_tuple(region.winding, rims, outlines));
  }
  return nb::make_tuple(to_array<double>(std::move(side.mesh.vertices)),
                        to_array<std::int32_t>(std::move(side.mesh.faces)), regions);
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
      "upside_down_share",
      [](const OutlineIn& outline, const FacesIn& triangles) {
        const std::vector<PlanePoint> points = to_plane_points(outline);
        return upside_down_share(points, to_faces(triangles, points.size()));
      },
      nb::arg("points"), nb::arg("triangles"),
      "Share of the area of triangles [T, 3] of points [N, 2] in the plane that is upside down.");
  m.def(
      "uncross",
      [](const PointsIn& vertices, const FacesIn& faces, const RimsIn& rims, const OutlinesIn& outlines) {
        OpenSide side{to_finite_mesh(vertices, faces), {}};
        side.rims = to_rims(rims, side.mesh.vertices.size());
        const std::vector<std::vector<PlanePoint>> points = to_outlines(outlines, side.rims);
        std::optional<UncrossedSide> uncrossed;
        {
          nb::gil_scoped_release release;
          uncrossed = uncross(std::move(side), points);
        }
        return uncrossed ? nb::object(as_tuple(std::move(*uncrossed))) : nb::none();
      },
      nb::arg("vertices"), nb::arg("faces"), nb::arg("rims"), nb::arg("outlines"),
      "One side of a cut whose rims cross, with a vertex at every crossing: vertices [V, 3], faces [F, 3] and a list\n"
      "of regions (winding number, rims, outlines) bounded by loops that do not cross, each to the left of its loops;\n"
      "None if there are too many crossings.");
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
