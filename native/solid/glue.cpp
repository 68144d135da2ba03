#include "solid/glue.hpp"

#include <algorithm>

#include "convex/polygon.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace {

using Outline = std::vector<PlanePoint>;

double doubled_area_of(const Outline& p) {
  double sum = 0;
  for (std::size_t i = 1; i + 1 < p.size(); ++i) sum += doubled_area(p[0], p[i], p[i + 1]);
  return sum;
}

// Thinner than kCoincident: left by rounding between two outlines that were meant to be equal.
bool is_film(const Outline& p) {
  double longest2 = 0;
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t j = i + 1; j < p.size(); ++j)
      longest2 =
          std::max(longest2, (p[i][0] - p[j][0]) * (p[i][0] - p[j][0]) + (p[i][1] - p[j][1]) * (p[i][1] - p[j][1]));
  return doubled_area_of(p) <= kCoincident * std::sqrt(longest2);
}

// Keeps what of a polygon lies left of the line through a and b; the rest goes to `right`. False if hardly anything
// does.
bool keep_left(Outline& polygon, PlanePoint a, PlanePoint b, Outline& right) {
  Outline left;
  const Lies lies = split(polygon, [a, b](PlanePoint p) { return -doubled_area(a, b, p); }, left, right);
  if (lies == Lies::kAcross)
    polygon.swap(left);
  else
    right.clear();
  return lies != Lies::kAbove && !is_film(polygon);
}

// Removes a triangle (counter-clockwise) from convex polygons.
void subtract(std::vector<Outline>& polygons, const std::array<PlanePoint, 3>& triangle) {
  std::vector<Outline> left;
  Outline right;
  for (Outline& p : polygons) {
    Outline rest = p;
    std::vector<Outline> pieces;
    bool overlaps = true;
    for (int e = 0; e < 3 && overlaps; ++e) {
      overlaps = keep_left(rest, triangle[e], triangle[(e + 1) % 3], right);
      if (!right.empty() && !is_film(right)) pieces.push_back(right);
    }
    if (overlaps)
      left.insert(left.end(), pieces.begin(), pieces.end());
    else
      left.push_back(std::move(p));  // what the triangle only touches stays whole
  }
  polygons = std::move(left);
}

// A triangle with its plane and the two coordinates it is projected to.
struct Facet {
  Vec3 corner[3], normal;
  double offset = 0, height = 0;  // height: twice the area over the longest edge
  Box box;
  int u = 0, v = 1;

  Facet(const Mesh& mesh, const Triangle& face) {
    double longest2 = 0;
    for (int i = 0; i < 3; ++i) {
      corner[i] = mesh.vertices[face[i]];
      box.extend(corner[i]);
    }
    for (int i = 0; i < 3; ++i) longest2 = std::max(longest2, norm2(corner[i] - corner[(i + 1) % 3]));
    const Vec3 n = long_normal(mesh, face);
    height = longest2 > 0 ? norm(n) / std::sqrt(longest2) : 0;
    normal = normalized(n);
    offset = dot(normal, corner[0]);
    const int drop = longest_axis(n);
    u = (drop + 1) % 3;
    v = (drop + 2) % 3;
    if (n[drop] < 0) std::swap(u, v);  // so that the triangle is counter-clockwise in (u, v)
  }

  PlanePoint project(Vec3 p) const { return {p[u], p[v]}; }
  Vec3 lift(PlanePoint p) const {
    const int drop = 3 - u - v;
    Vec3 x;
    x[u] = p[0];
    x[v] = p[1];
    x[drop] = (offset - normal[u] * p[0] - normal[v] * p[1]) / normal[drop];
    return x;
  }

  bool touches(const Facet& other) const {
    if (dot(normal, other.normal) >= 0) return false;
    for (const Vec3 p : other.corner)
      if (std::fabs(dot(normal, p) - offset) > kCoincident) return false;
    return true;
  }
};

std::vector<Facet> facets_within(const Mesh& mesh, const Box& box) {
  std::vector<Facet> result;
  for (const Triangle& face : mesh.faces) {
    const Facet facet(mesh, face);
    if (facet.height > kCoincident && facet.box.meets(box, kCoincident)) result.push_back(facet);
  }
  return result;
}

// Appends to `out` the part of mesh `a` that does not touch `b`.
void append_untouched(Mesh& out, const Mesh& a, const Mesh& b, const Box& common) {
  const std::vector<Facet> others = facets_within(b, common);
  // Unions are glued again and again, so vertices that no triangle needs any more are left behind.
  Renumbered taken_over(a.vertices, out.vertices);
  std::vector<Outline> polygons;
  for (const Triangle& face : a.faces) {
    poll_stop();
    const Facet facet(a, face);
    if (facet.height <= kCoincident) continue;  // its edges belong to its neighbours
    bool whole = true;
    if (facet.box.meets(common, kCoincident)) {
      for (const Facet& other : others) {
        if (!facet.box.meets(other.box, kCoincident) || !facet.touches(other)) continue;
        if (whole)
          polygons.assign(
              1, {facet.project(facet.corner[0]), facet.project(facet.corner[1]), facet.project(facet.corner[2])});
        whole = false;
        // Seen from this side the other triangle is clockwise.
        subtract(polygons,
                 {facet.project(other.corner[0]), facet.project(other.corner[2]), facet.project(other.corner[1])});
        if (polygons.empty()) break;
      }
    }
    if (whole) {
      out.faces.push_back(taken_over(face));
      continue;
    }
    for (const Outline& p : polygons) {
      const auto first = static_cast<std::int32_t>(out.vertices.size());
      for (const PlanePoint q : p) out.vertices.push_back(facet.lift(q));
      for (std::int32_t i = 1; i + 1 < static_cast<std::int32_t>(p.size()); ++i)
        out.faces.push_back({first, first + i, first + i + 1});
    }
  }
}

// Whether a triangle of one solid and an opposite one of the other share more than an edge.
bool share_area(const Facet& facet, const Facet& other) {
  if (!facet.box.meets(other.box, kCoincident) || !facet.touches(other)) return false;
  Outline common = {facet.project(facet.corner[0]), facet.project(facet.corner[1]), facet.project(facet.corner[2])};
  const PlanePoint outline[3] = {facet.project(other.corner[0]), facet.project(other.corner[2]),
                                 facet.project(other.corner[1])};
  Outline right;
  for (int e = 0; e < 3; ++e)
    if (!keep_left(common, outline[e], outline[(e + 1) % 3], right)) return false;
  return true;
}

}  // namespace

Mesh glue(const Mesh& a, const Mesh& b) {
  const Box box_a = box_of_faces(a), box_b = box_of_faces(b);
  Box common;
  for (int axis = 0; axis < 3; ++axis) {
    common.lower[axis] = std::max(box_a.lower[axis], box_b.lower[axis]);
    common.upper[axis] = std::min(box_a.upper[axis], box_b.upper[axis]);
  }
  Mesh out;
  append_untouched(out, a, b, common);
  append_untouched(out, b, a, common);
  if (!out.faces.empty()) return out;
  // Films thinner than kCoincident touch everywhere; what bounds them still has to be measured.
  out = a;
  append(out, b);
  return out;
}

void add_touching_planes(std::vector<Plane>& planes, const Mesh& a, const Mesh& b) {
  const std::vector<Facet> others = facets_within(b, box_of_faces(a));
  std::vector<Facet> own = facets_within(a, box_of_faces(b));
  // Large faces first: their planes are the most exact.
  std::stable_sort(own.begin(), own.end(), [](const Facet& f, const Facet& g) { return f.height > g.height; });
  for (const Facet& facet : own) {
    poll_stop();
    const bool is_known = std::any_of(planes.begin(), planes.end(), [&](const Plane& plane) {
      return std::all_of(std::begin(facet.corner), std::end(facet.corner),
                         [&](Vec3 p) { return std::fabs(plane.depth(p)) <= kCoincident; });
    });
    if (is_known) continue;
    if (std::any_of(others.begin(), others.end(), [&](const Facet& other) { return share_area(facet, other); }))
      planes.push_back({facet.normal, facet.offset});
  }
}

}  // namespace rlacd
