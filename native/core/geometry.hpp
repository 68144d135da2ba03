// Points, triangles and boxes: the basic types that every kernel shares.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace rlacd {

struct Vec3 {
  double x = 0, y = 0, z = 0;

  double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  double& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3 operator/(Vec3 a, double s) { return {a.x / s, a.y / s, a.z / s}; }
inline bool operator==(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm2(Vec3 a) { return dot(a, a); }
inline double norm(Vec3 a) { return std::sqrt(norm2(a)); }
inline Vec3 normalized(Vec3 a) {
  const double n = norm(a);
  return n > 0 ? (1 / n) * a : a;
}
// The axis along which a vector is longest, the first of several.
inline int longest_axis(Vec3 v) {
  const Vec3 a = {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)};
  return a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
}
inline double max_abs(Vec3 a) { return std::max(std::max(std::fabs(a.x), std::fabs(a.y)), std::fabs(a.z)); }

using Triangle = std::array<std::int32_t, 3>;  // indices of the corners, counter-clockwise seen from outside

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = 3.14159265358979323846;
constexpr double kHalfRootOfThree = 0.8660254037844387;  // the cosine of 30 degrees; half the diagonal of a cube

// What rounding may amount to, as a share of what is computed or of the coordinates that it is computed from; and what
// a single operation may add.
constexpr double kRounding = 1e-12, kLastBits = 1e-15;

// A length in the frame, whose longest side is 2, that counts as none: far above rounding, far below any tolerance.
constexpr double kHair = 1e-9;

using PlanePoint = std::array<double, 2>;

// Twice the area of a triangle, positive if it is counter-clockwise.
inline double doubled_area(PlanePoint a, PlanePoint b, PlanePoint c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// Whether the segments a-b and c-d cross between their ends, and where: shares of the way along each.
inline bool do_cross(PlanePoint a, PlanePoint b, PlanePoint c, PlanePoint d, std::array<double, 2>& along) {
  const double c_side = doubled_area(a, b, c), d_side = doubled_area(a, b, d);
  if (!(c_side < 0 ? d_side > 0 : c_side > 0 && d_side < 0)) return false;
  const double a_side = doubled_area(c, d, a), b_side = doubled_area(c, d, b);
  if (!(a_side < 0 ? b_side > 0 : a_side > 0 && b_side < 0)) return false;
  along = {a_side / (a_side - b_side), c_side / (c_side - d_side)};
  return true;
}

struct Mesh {
  std::vector<Vec3> vertices;
  std::vector<Triangle> faces;
};

using Corners = std::array<Vec3, 3>;
inline Corners corners_of(const Mesh& mesh, const Triangle& face) {
  return {mesh.vertices[face[0]], mesh.vertices[face[1]], mesh.vertices[face[2]]};
}
// Normal to a triangle, twice as long as its area.
inline Vec3 long_normal(const Corners& t) { return cross(t[1] - t[0], t[2] - t[0]); }
inline Vec3 long_normal(const Mesh& mesh, const Triangle& face) { return long_normal(corners_of(mesh, face)); }

// Normal to a flat polygon, twice as long as its area.
inline Vec3 polygon_normal(const std::vector<Vec3>& corners) {
  Vec3 doubled;
  for (std::size_t i = 2; i < corners.size(); ++i)
    doubled = doubled + cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
  return doubled;
}

// The side from corner k to the next that is longest, the first of several.
inline int longest_side(const Corners& t) {
  int longest = 0;
  for (int k = 1; k < 3; ++k)
    if (norm2(t[(k + 1) % 3] - t[k]) > norm2(t[(longest + 1) % 3] - t[longest])) longest = k;
  return longest;
}

// Across the longest side, so that they stay well shaped.
inline std::array<Corners, 2> halves(const Corners& t) {
  const int k = longest_side(t);
  const Vec3 p = t[k], q = t[(k + 1) % 3], tip = t[(k + 2) % 3], middle = 0.5 * (p + q);
  return {{{p, middle, tip}, {middle, q, tip}}};
}

inline std::vector<Vec3> joined(std::vector<Vec3> points, const std::vector<Vec3>& others) {
  points.insert(points.end(), others.begin(), others.end());
  return points;
}

inline void append(Mesh& out, const Mesh& other) {
  const auto first = static_cast<std::int32_t>(out.vertices.size());
  out.vertices.insert(out.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const Triangle& f : other.faces) out.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
}

// Appends the vertices that are asked for to others, in that order, and gets their numbers there.
class Renumbered {
 public:
  Renumbered(const std::vector<Vec3>& from, std::vector<Vec3>& to) : from_(from), to_(to), number_(from.size(), -1) {}
  std::int32_t operator()(std::int32_t vertex) {
    std::int32_t& number = number_[vertex];
    if (number < 0) number = static_cast<std::int32_t>(to_.size()), to_.push_back(from_[vertex]);
    return number;
  }
  Triangle operator()(const Triangle& f) { return {(*this)(f[0]), (*this)(f[1]), (*this)(f[2])}; }

 private:
  const std::vector<Vec3>& from_;
  std::vector<Vec3>& to_;
  std::vector<std::int32_t> number_;
};

struct Box {
  Vec3 lower{kInfinity, kInfinity, kInfinity};
  Vec3 upper{-kInfinity, -kInfinity, -kInfinity};

  template <class Points>
  static Box of(const Points& points) {
    Box box;
    for (const Vec3 p : points) box.extend(p);
    return box;
  }
  void extend(Vec3 p) {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
  }
  bool is_empty() const { return !(lower.x <= upper.x); }
  void extend(const Box& other) {  // must not be empty
    extend(other.lower);
    extend(other.upper);
  }
  bool holds(Vec3 p) const {
    return lower.x <= p.x && p.x <= upper.x && lower.y <= p.y && p.y <= upper.y && lower.z <= p.z && p.z <= upper.z;
  }
  bool meets(const Box& other, double slack = 0) const {
    for (int axis = 0; axis < 3; ++axis)
      if (lower[axis] > other.upper[axis] + slack || other.lower[axis] > upper[axis] + slack) return false;
    return true;
  }
  double distance2(Vec3 p) const {
    const double x = std::max(std::max(lower.x - p.x, p.x - upper.x), 0.0);
    const double y = std::max(std::max(lower.y - p.y, p.y - upper.y), 0.0);
    const double z = std::max(std::max(lower.z - p.z, p.z - upper.z), 0.0);
    return x * x + y * y + z * z;
  }
};

// The box of the corners of a mesh's faces.
inline Box box_of_faces(const Mesh& mesh) {
  Box box;
  for (const Triangle& face : mesh.faces)
    for (const std::int32_t corner : face) box.extend(mesh.vertices[corner]);
  return box;
}

struct Plane {  // normal . x = offset
  Vec3 normal;
  double offset;
  double depth(Vec3 p) const { return offset - dot(normal, p); }  // below it
};
using HalfSpace = Plane;  // what lies below it: normal . x <= offset

// How far a box reaches from its middle along a direction, given half its extents.
inline double reach_along(Vec3 n, Vec3 half) {
  return std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
}

}  // namespace rlacd
