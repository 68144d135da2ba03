// Kernels as functions of numpy arrays: `released(kernel)` takes the arrays that the kernel's parameters come from,
// makes them, runs the kernel and turns its result into rows, all without the GIL; rows become arrays once it is held
// again.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

namespace nb = nanobind;
using namespace nb::literals;

template <class Scalar, class Shape>
using ArrayIn = nb::ndarray<const Scalar, Shape, nb::c_contig, nb::device::cpu>;
using PointsIn = ArrayIn<double, nb::shape<-1, 3>>;
using FacesIn = ArrayIn<std::int32_t, nb::shape<-1, 3>>;
using WideFacesIn = ArrayIn<std::int64_t, nb::shape<-1, 3>>;
using PairsIn = ArrayIn<std::int32_t, nb::shape<-1, 2>>;
using PlanesIn = ArrayIn<double, nb::shape<-1, 4>>;
template <class Scalar>
using VectorIn = ArrayIn<Scalar, nb::ndim<1>>;

inline void require(bool holds, const char* otherwise) {
  if (!holds) throw std::invalid_argument(otherwise);
}

// Beyond this, squared distances overflow, and no triangle would be found nearest.
constexpr double kFarthest = 1e150;

// Kernels compare distances: every comparison with a NaN is false, so it would go unnoticed.
inline void require_finite(const std::vector<Vec3>& points) {
  bool finite = true, near = true;
  for (const Vec3 p : points)
    for (const double x : {p.x, p.y, p.z}) {
      finite &= std::isfinite(x);
      near &= std::fabs(x) <= kFarthest;
    }
  require(finite, "a point is not finite");
  require(near, "a point lies beyond 1e150, where distances have no value");
}

template <class Row, class Array>
std::vector<Row> copied(const Array& array) {
  static_assert(sizeof(Row) % sizeof(typename Array::Scalar) == 0, "a row is a whole number of scalars");
  std::vector<Row> rows(array.size() * sizeof(typename Array::Scalar) / sizeof(Row));
  if (!rows.empty()) std::memcpy(static_cast<void*>(rows.data()), array.data(), rows.size() * sizeof(Row));
  return rows;
}

inline std::vector<Vec3> to_points(const PointsIn& array) {
  std::vector<Vec3> points = copied<Vec3>(array);
  require_finite(points);
  return points;
}

// Copies indices in and checks them, so that no kernel can read out of bounds.
template <class Row, class Array>
std::vector<Row> to_indices(const Array& array, std::int64_t count, const char* otherwise) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  require(count >= 0 && count <= kMost && array.size() <= static_cast<std::size_t>(kMost),
          "too many vertices or faces");
  std::vector<Row> rows(array.size() * sizeof(std::int32_t) / sizeof(Row));
  auto* own = reinterpret_cast<std::int32_t*>(rows.data());
  const auto* index = array.data();
  bool holds = true;
  for (std::size_t i = 0, size = array.size(); i < size; ++i) {
    holds &= index[i] >= 0 && index[i] < count;
    own[i] = static_cast<std::int32_t>(index[i]);
  }
  require(holds, otherwise);
  return rows;
}

template <class Faces>
std::vector<Triangle> to_faces(const Faces& array, std::int64_t vertices) {
  return to_indices<Triangle>(array, vertices, "face index out of range");
}

template <class Array>
std::vector<std::int32_t> to_numbers(const Array& array, std::size_t count) {
  return to_indices<std::int32_t>(array, static_cast<std::int64_t>(count), "a number is out of range");
}

// Meshes whose vertices may be anything; the faces of a wide one have the width of Python's own topology.
struct AnyMesh : Mesh {};
struct WideMesh : Mesh {};

// From which arguments a kernel's parameter is made, and how.
template <class T>
struct FromArrays;
template <>
struct FromArrays<std::vector<Vec3>> {
  using Arguments = std::tuple<PointsIn>;
  static std::vector<Vec3> make(const PointsIn& points) { return to_points(points); }
};
template <class Made, class Faces>
struct MeshFromArrays {
  using Arguments = std::tuple<PointsIn, Faces>;
  static Made make(const PointsIn& vertices, const Faces& faces) {
    Made mesh;
    mesh.vertices = copied<Vec3>(vertices);
    mesh.faces = to_faces(faces, static_cast<std::int64_t>(vertices.shape(0)));
    if constexpr (std::is_same_v<Made, Mesh>) require_finite(mesh.vertices);
    return mesh;
  }
};
template <>
struct FromArrays<Mesh> : MeshFromArrays<Mesh, FacesIn> {};
template <>
struct FromArrays<AnyMesh> : MeshFromArrays<AnyMesh, FacesIn> {};
template <>
struct FromArrays<WideMesh> : MeshFromArrays<WideMesh, WideFacesIn> {};
template <>
struct FromArrays<std::vector<Mesh>> {
  using Arguments = std::tuple<std::vector<PointsIn>, std::vector<FacesIn>>;
  static std::vector<Mesh> make(const std::vector<PointsIn>& vertices, const std::vector<FacesIn>& faces) {
    require(vertices.size() == faces.size(), "one array of faces for each array of vertices");
    std::vector<Mesh> meshes;
    for (std::size_t i = 0; i < faces.size(); ++i) meshes.push_back(FromArrays<Mesh>::make(vertices[i], faces[i]));
    return meshes;
  }
};
template <>
struct FromArrays<std::vector<HalfSpace>> {
  using Arguments = std::tuple<PlanesIn>;
  static std::vector<HalfSpace> make(const PlanesIn& planes) {
    std::vector<HalfSpace> spaces = copied<HalfSpace>(planes);
    for (const HalfSpace& space : spaces) require_finite({space.normal});
    return spaces;
  }
};

template <class P, class = void>
struct Parameter {
  using Arguments = std::tuple<P>;
  static P make(P own) { return static_cast<P>(own); }
};
template <class P>
struct Parameter<P, std::void_t<typename FromArrays<std::decay_t<P>>::Arguments>> : FromArrays<std::decay_t<P>> {};

// What a kernel that runs without the GIL returns: rows that become an array once it is held again.
template <class Scalar, class Row>
struct Rows {
  std::vector<Row> rows;
};

template <class T>
struct Tag {};

// The scalars of a row that becomes a row of an array; of other types nothing.
bool scalar(Tag<char>);
double scalar(Tag<double>);
float scalar(Tag<float>);
std::int32_t scalar(Tag<std::int32_t>);
std::int64_t scalar(Tag<std::int64_t>);
double scalar(Tag<Vec3>);
double scalar(Tag<Box>);
double scalar(Tag<HalfSpace>);
template <class Scalar, std::size_t columns>
Scalar scalar(Tag<std::array<Scalar, columns>>);
void scalar(...);

template <template <class...> class Of, class T>
constexpr bool is_a = false;
template <template <class...> class Of, class... T>
constexpr bool is_a<Of, Of<T...>> = true;

// The parts of a struct that becomes a tuple of them; of other types nothing.
inline auto parts(Mesh& own) { return std::tie(own.vertices, own.faces); }
inline auto parts(Vec3& own) { return std::tie(own.x, own.y, own.z); }
template <class T, std::size_t n>
auto parts(std::array<T, n>& own) {
  return std::apply([](auto&... part) { return std::tie(part...); }, own);
}
void parts(...);

// Rows of a fixed number become an array too.
template <std::size_t n>
auto out(const std::array<Vec3, n>& own) {
  return Rows<double, Vec3>{{own.begin(), own.end()}};
}

// A kernel's result as what nanobind turns into Python's: vectors of rows become arrays, structs tuples.
template <class T>
auto out(T own) {
  const auto each = [](auto&... part) { return std::tuple(out(std::move(part))...); };
  if constexpr (is_a<std::vector, T>) {
    using Row = typename T::value_type;
    using Scalar = decltype(scalar(Tag<Row>()));
    if constexpr (!std::is_void_v<Scalar>) {
      own.shrink_to_fit();  // it may live for long
      return Rows<Scalar, Row>{std::move(own)};
    } else {
      std::vector<decltype(out(std::declval<Row>()))> all;
      for (Row& row : own) all.push_back(out(std::move(row)));
      return all;
    }
  } else if constexpr (is_a<std::optional, T>) {
    return own ? std::optional(out(std::move(*own))) : std::nullopt;
  } else if constexpr (is_a<std::tuple, T> || is_a<std::pair, T>) {
    return std::apply(each, own);
  } else if constexpr (!std::is_void_v<decltype(parts(own))>) {
    return std::apply(each, parts(own));
  } else {
    return own;
  }
}

template <class... P>
struct Types {};

template <std::size_t first, class Kernel, class Arguments, class... Made>
decltype(auto) call(const Kernel& kernel, Arguments&, Types<>, Made&... made) {
  return kernel(made...);
}
// Makes the next parameter, of the arguments from `first` on.
template <std::size_t first, class Kernel, class Arguments, class P, class... Rest, class... Made>
decltype(auto) call(const Kernel& kernel, Arguments& arguments, Types<P, Rest...>, Made&... made) {
  constexpr std::size_t count = std::tuple_size_v<typename Parameter<P>::Arguments>;
  const auto make = [&](auto... k) -> decltype(auto) {
    return Parameter<P>::make(std::get<first + k.value>(arguments)...);
  };
  const auto next = [&](auto&& own) -> decltype(auto) {
    return call<first + count>(kernel, arguments, Types<Rest...>(), made..., own);
  };
  if constexpr (count == 1)
    return next(make(std::integral_constant<std::size_t, 0>()));
  else
    return next(make(std::integral_constant<std::size_t, 0>(), std::integral_constant<std::size_t, 1>()));
}

template <class Kernel, class... P, class... Argument>
auto released_with(Kernel kernel, Types<P...> parameters, const std::tuple<Argument...>*) {
  return [=](Argument... arguments) {
    const nb::gil_scoped_release unlocked;  // between the conversions of arguments and results
    auto all = std::forward_as_tuple(arguments...);
    if constexpr (std::is_void_v<decltype(call<0>(kernel, all, parameters))>)
      call<0>(kernel, all, parameters);
    else
      return out(call<0>(kernel, all, parameters));
  };
}

template <class Kernel, class... P>
auto released_as(Kernel kernel, Types<P...> parameters) {
  using Arguments = decltype(std::tuple_cat(std::declval<typename Parameter<P>::Arguments>()...));
  return released_with(kernel, parameters, static_cast<const Arguments*>(nullptr));
}

template <class R, class... P>
auto released(R (*kernel)(P...)) {
  return released_as(kernel, Types<P...>());
}
template <class R, class C, class... P>
auto released(R (C::*kernel)(P...) const) {
  return released_as([kernel](const C& self, const P&... own) { return (self.*kernel)(own...); },
                     Types<const C&, P...>());
}
template <class Kernel, class R, class... P>
auto released_functor(Kernel kernel, R (Kernel::*)(P...) const) {
  return released_as(kernel, Types<P...>());
}
template <class Kernel, class = decltype(&Kernel::operator())>
auto released(Kernel kernel) {
  return released_functor(kernel, &Kernel::operator());
}

}  // namespace rlacd

namespace nanobind::detail {

template <class Scalar, class Row>
struct type_caster<rlacd::Rows<Scalar, Row>> {
  using Array = make_caster<ndarray<numpy, Scalar>>;
  static constexpr auto Name = Array::Name;
  // Hands the rows to numpy without copying; the array then owns the data.
  static handle from_cpp(rlacd::Rows<Scalar, Row>&& own, rv_policy, cleanup_list* cleanup) {
    constexpr std::size_t columns = sizeof(Row) / sizeof(Scalar);
    auto* rows = new std::vector<Row>(std::move(own.rows));
    const capsule owner(rows, [](void* p) noexcept { delete static_cast<std::vector<Row>*>(p); });
    const std::size_t shape[] = {rows->size(), columns};
    return Array::from_cpp({reinterpret_cast<Scalar*>(rows->data()), columns == 1 ? 1u : 2u, shape, owner},
                           rv_policy::automatic, cleanup);
  }
};

}  // namespace nanobind::detail
