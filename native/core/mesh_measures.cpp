#include "core/mesh_measures.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rlacd {

namespace {

constexpr int kSweeps = 30;  // five are enough

using Moments = std::array<Vec3, 3>;  // second ones about a centroid, row-major, up to a positive factor

void add(Moments& moments, double weight, Vec3 p) {
  for (int i = 0; i < 3; ++i) moments[i] = moments[i] + weight * p[i] * p;
}

// Of the surface, exact over each triangle.
Moments moments_of(const Mesh& mesh) {
  std::vector<double> areas;
  areas.reserve(mesh.faces.size());
  double total = 0;
  Vec3 centroid;
  for (const Triangle& f : mesh.faces) {
    const auto [a, b, c] = corners_of(mesh, f);
    areas.push_back(norm(long_normal(mesh, f)));
    total += areas.back();
    centroid = centroid + areas.back() / 3 * (a + b + c);
  }
  Moments moments{};
  if (!(total > 0)) return moments;
  centroid = 1 / total * centroid;
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const Corners t = corners_of(mesh, mesh.faces[i]);
    const Vec3 a = t[0] - centroid, b = t[1] - centroid, c = t[2] - centroid;
    const double weight = areas[i] / total;
    for (const Vec3 p : {a, b, c, a + b + c}) add(moments, weight, p);
  }
  return moments;
}

Moments moments_of(const std::vector<Vec3>& points) {
  Vec3 centroid;
  for (const Vec3 p : points) centroid = centroid + 1 / static_cast<double>(points.size()) * p;
  Moments moments{};
  for (const Vec3 p : points) add(moments, 1, p - centroid);
  return moments;
}

// One rotation of Jacobi's method: in the plane of two axes, to where their joint moment vanishes.
void rotate(Moments& moments, std::array<Vec3, 3>& axes, int p, int q) {
  const double theta = (moments[q][q] - moments[p][p]) / (2 * moments[p][q]);
  const double tangent = std::copysign(1.0, theta) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
  const double cosine = 1 / std::sqrt(tangent * tangent + 1), sine = tangent * cosine;
  const auto turn = [cosine, sine](double& a, double& b) {
    const double before = a;
    a = cosine * before - sine * b;
    b = sine * before + cosine * b;
  };
  for (int i = 0; i < 3; ++i) turn(moments[i][p], moments[i][q]);
  for (int i = 0; i < 3; ++i) turn(moments[p][i], moments[q][i]);
  for (int i = 0; i < 3; ++i) turn(axes[p][i], axes[q][i]);
}

// Jacobi's method takes sums, products, quotients and square roots alone, which IEEE 754 rounds the same everywhere.
std::array<Vec3, 3> axes_of(Moments moments) {
  std::array<Vec3, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  // Entries this small beside the trace are rounding: no axis turns for them.
  const double negligible = kLastBits * (moments[0].x + moments[1].y + moments[2].z);
  bool turned = true;
  for (int sweep = 0; turned && sweep < kSweeps; ++sweep) {
    turned = false;
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      if (!(std::fabs(moments[p][q]) > negligible)) continue;
      rotate(moments, axes, p, q);
      turned = true;
    }
  }
  std::array<int, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&moments](int a, int b) { return moments[a][a] > moments[b][b]; });
  std::array<Vec3, 3> sorted;
  for (int i = 0; i < 3; ++i) {
    const Vec3 axis = axes[order[i]];
    const double most = max_abs(axis);
    int first = 0;
    while (std::fabs(axis[first]) < most) ++first;
    sorted[i] = axis[first] < 0 ? -axis : axis;
  }
  return sorted;
}

}  // namespace

double mesh_volume(const Mesh& mesh) {
  if (mesh.faces.empty()) return 0;
  const Vec3 apex = mesh.vertices[mesh.faces[0][0]];
  double sum = 0;
  for (const Triangle& f : mesh.faces) {
    const auto [a, b, c] = corners_of(mesh, f);
    sum += dot(a - apex, cross(b - apex, c - apex));
  }
  return sum / 6;
}

double mesh_area(const Mesh& mesh) {
  double sum = 0;
  for (const Triangle& f : mesh.faces) sum += norm(long_normal(mesh, f));
  return sum / 2;
}

std::array<Vec3, 3> principal_axes(const Mesh& mesh) { return axes_of(moments_of(mesh)); }

std::array<Vec3, 3> principal_axes(const std::vector<Vec3>& points) { return axes_of(moments_of(points)); }

// Sums over the tetrahedra between the faces and an apex, all relative to the apex: with corners 0, a, b, c, s = a + b
// + c and volume v, the integral of x is v s / 4, and that of x x^T is v (a a^T + b b^T + c c^T + s s^T) / 20.
Mass mesh_mass(const Mesh& mesh) {
  Mass mass;
  if (mesh.faces.empty()) return mass;
  const Vec3 apex = mesh.vertices[mesh.faces[0][0]];
  double sixfold = 0;
  Vec3 first;
  std::array<Vec3, 3> second{};
  for (const Triangle& f : mesh.faces) {
    const Corners t = corners_of(mesh, f);
    const Vec3 a = t[0] - apex, b = t[1] - apex, c = t[2] - apex, s = a + b + c;
    const double v = dot(a, cross(b, c));
    sixfold += v;
    first = first + v * s;
    for (const Vec3 p : {a, b, c, s})
      for (int i = 0; i < 3; ++i) second[i] = second[i] + v * p[i] * p;
  }
  mass.volume = sixfold / 6;
  const Vec3 centre = sixfold != 0 ? 1 / (4 * sixfold) * first : Vec3{};
  mass.centre = apex + centre;
  for (int i = 0; i < 3; ++i) second[i] = 1.0 / 120 * second[i] - mass.volume * centre[i] * centre;
  const double trace = second[0].x + second[1].y + second[2].z;
  for (int i = 0; i < 3; ++i) {
    mass.inertia[i] = -second[i];
    mass.inertia[i][i] += trace;
  }
  return mass;
}

}  // namespace rlacd
