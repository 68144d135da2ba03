#include "solid/touching.hpp"

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

// Keeps what of a polygon lies left of the line through a and b; false if hardly anything does.
bool keep_left(Outline& polygon, PlanePoint a, PlanePoint b) {
  return keep_below(polygon, [a, b](PlanePoint p) { return -doubled_area(a, b, p); }) && !is_film(polygon);
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

// Whether a triangle of one solid and an opposite one of the other share more than an edge.
bool share_area(const Facet& facet, const Facet& other) {
  if (!facet.box.meets(other.box, kCoincident) || !facet.touches(other)) return false;
  Outline common = {facet.project(facet.corner[0]), facet.project(facet.corner[1]), facet.project(facet.corner[2])};
  const PlanePoint outline[3] = {facet.project(other.corner[0]), facet.project(other.corner[2]),
                                 facet.project(other.corner[1])};
  for (int e = 0; e < 3; ++e)
    if (!keep_left(common, outline[e], outline[(e + 1) % 3])) return false;
  return true;
}

}  // namespace

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
