// Conversion between numpy arrays and the kernels' own types.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <cstring>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "base/geometry.hpp"
#include "base/kernel_time.hpp"

namespace rlacd {

namespace nb = nanobind;

using PointsIn = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using FacesIn = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using VectorIn = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IndicesIn = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using PairsIn = nb::ndarray<const std::int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using PlanesIn = nb::ndarray<const double, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;

static_assert(sizeof(Vec3) == 3 * sizeof(double), "points are copied as raw rows");
static_assert(sizeof(Triangle) == 3 * sizeof(std::int32_t), "faces are copied as raw rows");

inline std::vector<Vec3> to_points(const PointsIn& array) {
  std::vector<Vec3> points(array.shape(0));
  if (!points.empty()) std::memcpy(static_cast<void*>(points.data()), array.data(), points.size() * sizeof(Vec3));
  return points;
}

// Copies numbers of `count` items in, and checks them.
template <class Array>
std::vector<std::int32_t> to_numbers(const Array& array, std::size_t count) {
  std::vector<std::int32_t> numbers(array.data(), array.data() + array.size());
  for (const std::int32_t i : numbers)
    if (i < 0 || i >= static_cast<std::int64_t>(count)) throw std::invalid_argument("a number is out of range");
  return numbers;
}

// Copies faces in and checks their indices, so that no kernel can read out of bounds.
inline std::vector<Triangle> to_faces(const FacesIn& array, std::size_t vertices) {
  std::vector<Triangle> faces(array.shape(0));
  if (!faces.empty()) std::memcpy(static_cast<void*>(faces.data()), array.data(), faces.size() * sizeof(Triangle));
  const auto count = static_cast<std::int64_t>(vertices);
  for (const Triangle& face : faces)
    for (const std::int32_t corner : face)
      if (corner < 0 || corner >= count) throw std::invalid_argument("face index out of range");
  return faces;
}

inline Mesh to_mesh(const PointsIn& vertices, const FacesIn& faces) {
  Mesh mesh;
  mesh.vertices = to_points(vertices);
  mesh.faces = to_faces(faces, mesh.vertices.size());
  return mesh;
}

// Beyond this, squared distances overflow, and no triangle would be found nearest.
constexpr double kFarthest = 1e150;

inline void require_finite(const std::vector<Vec3>& points) {
  for (const Vec3 p : points)
    for (const double x : {p.x, p.y, p.z}) {
      if (!std::isfinite(x)) throw std::invalid_argument("a point is not finite");
      if (std::fabs(x) > kFarthest)
        throw std::invalid_argument("a point lies beyond 1e150, where distances have no value");
    }
}

// Like to_mesh, for kernels that compare distances: every comparison with a NaN is false, so it would go unnoticed.
inline Mesh to_finite_mesh(const PointsIn& vertices, const FacesIn& faces) {
  Mesh mesh = to_mesh(vertices, faces);
  require_finite(mesh.vertices);
  return mesh;
}

// One mesh for each pair of arrays.
inline std::vector<Mesh> to_finite_meshes(const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces) {
  if (vertices.size() != faces.size()) throw std::invalid_argument("one array of faces for each array of vertices");
  std::vector<Mesh> meshes;
  for (std::size_t i = 0; i < vertices.size(); ++i) meshes.push_back(to_finite_mesh(vertices[i], faces[i]));
  return meshes;
}

// Hands a vector of rows to numpy without copying; the array then owns the data.
template <class Scalar, class Row>
nb::ndarray<nb::numpy, Scalar> to_array(std::vector<Row>&& rows) {
  constexpr std::size_t columns = sizeof(Row) / sizeof(Scalar);
  static_assert(sizeof(Row) % sizeof(Scalar) == 0, "a row is a whole number of scalars");
  auto* owned = new std::vector<Row>(std::move(rows));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<Row>*>(p); });
  if constexpr (columns == 1)
    return nb::ndarray<nb::numpy, Scalar>(reinterpret_cast<Scalar*>(owned->data()), {owned->size()}, owner);
  else
    return nb::ndarray<nb::numpy, Scalar>(reinterpret_cast<Scalar*>(owned->data()), {owned->size(), columns}, owner);
}

// What a kernel that runs without the GIL returns: rows that become an array once it is held again.
template <class Scalar, class Row>
struct Rows {
  std::vector<Row> rows;
};
template <class Scalar, class Row>
Rows<Scalar, Row> rows(std::vector<Row> own) {
  return {std::move(own)};
}

using MeshOut = std::tuple<Rows<double, Vec3>, Rows<std::int32_t, Triangle>>;
inline MeshOut out(Mesh mesh) {
  return {rows<double>(std::move(mesh.vertices)), rows<std::int32_t>(std::move(mesh.faces))};
}

// The GIL is held while arguments and results are converted, and not in between.
struct WithoutGil {
  nb::gil_scoped_release released;
  double begun = thread_seconds();
  ~WithoutGil() {
    kernel_time.unlocked += thread_seconds() - begun;
    ++kernel_time.kernels;
  }
};
using Released = nb::call_guard<WithoutGil>;

}  // namespace rlacd

namespace nanobind::detail {

template <class Scalar, class Row>
struct type_caster<rlacd::Rows<Scalar, Row>> {
  using Array = make_caster<ndarray<numpy, Scalar>>;
  static constexpr auto Name = Array::Name;
  static handle from_cpp(rlacd::Rows<Scalar, Row>&& own, rv_policy policy, cleanup_list* cleanup) {
    return Array::from_cpp(rlacd::to_array<Scalar>(std::move(own.rows)), policy, cleanup);
  }
};

}  // namespace nanobind::detail
