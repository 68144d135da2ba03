#include "surface/winding.hpp"

#include <limits>
#include <optional>

#include "core/elementary.hpp"

namespace rlacd {
namespace {

// Solid angle of the triangle seen from p (Van Oosterom and Strackee, 1983), positive when p is behind it.
double solid_angle(const TriangleFrame& t, Vec3 p) {
  const Vec3 a = t.a - p, b = t.a + t.ab - p, c = t.a + t.ac - p;
  const double la = norm(a), lb = norm(b), lc = norm(c);
  return 2 * angle_of(dot(a, cross(t.ab, t.ac)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

double radius_around(Vec3 centre, const Box& box) {
  const Vec3 reach = {std::max(centre.x - box.lower.x, box.upper.x - centre.x),
                      std::max(centre.y - box.lower.y, box.upper.y - centre.y),
                      std::max(centre.z - box.lower.z, box.upper.z - centre.z)};
  return norm(reach);
}

// The direction of rays: few edges or faces that people make are parallel to it.
constexpr Vec3 kRay = {0.3713906763541037, 0.5570860145311556, 0.7427813527082074};

// Where rounding could decide, the expansion does, to this accuracy.
constexpr double kInDoubt = 4;

bool meets(const Box& box, Vec3 p) {
  double enter = 0, leave = kInfinity;
  for (int i = 0; i < 3; ++i) {
    enter = std::max(enter, (box.lower[i] - p[i]) / kRay[i]);
    leave = std::min(leave, (box.upper[i] - p[i]) / kRay[i]);
  }
  return enter <= leave * (1 + kRounding);
}

// 1 where the ray from p leaves through the triangle, -1 where it enters, 0 where it passes by (Moeller and Trumbore,
// 1997); nothing if rounding could decide that.
std::optional<int> crossing(const TriangleFrame& t, Vec3 p) {
  const Vec3 away = p - t.a, across = cross(kRay, t.ac), above = cross(away, t.ab);
  const double b = dot(away, across), c = dot(kRay, above), a = dot(t.ab, across) - b - c;
  const double edge = std::sqrt(t.longest2), rounding = kRounding * edge * (edge + norm(away));
  int least = 1, most = -1;
  for (const double part : {a, b, c}) {
    const int sign = part > rounding ? 1 : part < -rounding ? -1 : 0;
    least = std::min(least, sign), most = std::max(most, sign);
  }
  const int side = least + most;
  const double ahead = side * dot(t.ac, above);
  if (least * most < 0 || ahead < -rounding * edge) return 0;
  if (least * most == 0 || ahead <= rounding * edge) return std::nullopt;
  return side < 0 ? 1 : -1;
}

// Adds the first moments of a group about its own centre to those about `centre`.
void add_first(Vec3* rows, const Vec3* own, Vec3 shift, Vec3 normal) {
  for (int i = 0; i < 3; ++i) rows[i] = rows[i] + own[i] + shift[i] * normal;
}

}  // namespace

Winding::Moments Winding::of_leaf(std::int32_t first_slot, std::int32_t count, const Box& box) const {
  Moments m;
  Vec3 sum;
  for (std::int32_t slot = first_slot; slot < first_slot + count; ++slot) {
    const TriangleFrame& t = bvh_.triangle(slot);
    const double area = 0.5 * norm(cross(t.ab, t.ac));
    m.area += area;
    sum = sum + area * (t.a + (1.0 / 3.0) * (t.ab + t.ac));
  }
  m.centre = m.area > 0 ? (1 / m.area) * sum : 0.5 * (box.lower + box.upper);
  for (std::int32_t slot = first_slot; slot < first_slot + count; ++slot) {
    const TriangleFrame& t = bvh_.triangle(slot);
    const Vec3 normal = 0.5 * cross(t.ab, t.ac), none[3] = {};
    m.normal = m.normal + normal;
    add_first(m.first, none, t.a + (1.0 / 3.0) * (t.ab + t.ac) - m.centre, normal);
  }
  m.radius = radius_around(m.centre, box);
  return m;
}

Winding::Moments Winding::joined(const Moments& a, const Moments& b, const Box& box) {
  Moments m;
  m.area = a.area + b.area;
  m.centre = m.area > 0 ? (1 / m.area) * (a.area * a.centre + b.area * b.centre) : 0.5 * (box.lower + box.upper);
  m.normal = a.normal + b.normal;
  add_first(m.first, a.first, a.centre - m.centre, a.normal);
  add_first(m.first, b.first, b.centre - m.centre, b.normal);
  m.radius = radius_around(m.centre, box);
  return m;
}

Winding::Winding(const Bvh& bvh) : bvh_(bvh), moments_(2 * bvh.nodes().size()) {
  const std::vector<Bvh::Node>& nodes = bvh.nodes();
  for (std::size_t n = nodes.size(); n-- > 0;)
    for (int side = 0; side < 2; ++side) {
      const std::int32_t child = nodes[n].child[side];
      const Box& box = nodes[n].box[side];
      Moments& m = moments_[2 * n + side];
      if (child >= 0)
        m = joined(moments_[2 * child], moments_[2 * child + 1], box);
      else if (nodes[n].leaf_size[side] > 0)
        m = of_leaf(~child, nodes[n].leaf_size[side], box);
    }
}

double Winding::at(Vec3 p, double accuracy) const {
  const std::vector<Bvh::Node>& nodes = bvh_.nodes();
  double angle = 0;
  std::int32_t stack[Bvh::kStack];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t n = stack[--top];
    for (int side = 0; side < 2; ++side) {
      const std::int32_t child = nodes[n].child[side], count = nodes[n].leaf_size[side];
      const Moments& m = moments_[2 * static_cast<std::size_t>(n) + side];
      const Vec3 r = m.centre - p;
      const double distance = norm(r);
      if (distance > accuracy * m.radius && (child >= 0 || count > 0)) {
        const double inverse3 = 1 / (distance * distance * distance);
        double first = m.first[0].x + m.first[1].y + m.first[2].z;  // the trace: delta_ij / r^3
        double twisted = 0;                                         // 3 r_i r_j / r^5
        for (int i = 0; i < 3; ++i) twisted += r[i] * dot(m.first[i], r);
        first -= 3 * twisted / (distance * distance);
        angle += inverse3 * (dot(m.normal, r) + first);
      } else if (child >= 0) {
        stack[top++] = child;
      } else {
        for (std::int32_t i = 0; i < count; ++i) angle += solid_angle(bvh_.triangle(~child + i), p);
      }
    }
  }
  return angle / (4 * kPi);
}

double Winding::of_closed(Vec3 p) const {
  int left = 0;
  const bool is_in_doubt = bvh_.any_of([p](const Box& box) { return meets(box, p); },
                                       [&](std::int32_t slot) {
                                         const std::optional<int> sign = crossing(bvh_.triangle(slot), p);
                                         left += sign.value_or(0);
                                         return !sign;
                                       });
  return is_in_doubt ? std::round(at(p, kInDoubt)) : left;
}

}  // namespace rlacd
