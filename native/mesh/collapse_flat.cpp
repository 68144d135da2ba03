#include "mesh/collapse_flat.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/stop.hpp"

namespace rlacd {

namespace {

constexpr double kFlat = 1e-9;  // distance from a plane; the frame's longest side is 2

class Collapser {
 public:
  explicit Collapser(Mesh& mesh) : mesh_(mesh), around_(mesh.vertices.size()) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
      for (const std::int32_t v : mesh.faces[f]) around_[v].push_back(static_cast<std::int32_t>(f));
  }

  // Moves a vertex onto the nearest neighbour that it may move to.
  bool collapse(std::int32_t v) {
    std::vector<std::pair<double, std::int32_t>> targets;
    for (const std::int32_t u : neighbours(v)) targets.push_back({norm2(at(u) - at(v)), u});
    std::sort(targets.begin(), targets.end());
    for (const auto& [distance2, u] : targets)
      if (may_move(v, u)) {
        move(v, u);
        return true;
      }
    return false;
  }

  // Drops the faces that are gone, and unused vertices.
  void compact() {
    std::vector<std::int32_t> number(mesh_.vertices.size(), -1);
    std::vector<Vec3> vertices;
    std::size_t kept = 0;
    for (Triangle f : mesh_.faces) {
      if (f[0] < 0) continue;
      for (std::int32_t& v : f) {
        if (number[v] < 0)
          number[v] = static_cast<std::int32_t>(vertices.size()), vertices.push_back(mesh_.vertices[v]);
        v = number[v];
      }
      mesh_.faces[kept++] = f;
    }
    mesh_.faces.resize(kept);
    mesh_.vertices = std::move(vertices);
  }

 private:
  Vec3 at(std::int32_t v) const { return mesh_.vertices[v]; }

  std::vector<std::int32_t> neighbours(std::int32_t v) const {
    std::vector<std::int32_t> found;
    for (const std::int32_t f : around_[v])
      for (const std::int32_t u : mesh_.faces[f])
        if (u != v) found.push_back(u);
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  bool may_move(std::int32_t v, std::int32_t u) const {
    const Vec3 to = at(u) - at(v);
    std::size_t shared = 0;
    for (const std::int32_t f : around_[v]) {
      Triangle face = mesh_.faces[f];
      if (std::find(face.begin(), face.end(), u) != face.end()) {
        ++shared;
        continue;
      }
      const Vec3 before = long_normal(mesh_, face);
      std::replace(face.begin(), face.end(), v, u);
      const Vec3 after = long_normal(mesh_, face);
      if (std::fabs(dot(before, to)) > kFlat * norm(before)) return false;
      if (!(dot(before, after) > 0) || norm2(cross(before, after)) > kFlat * kFlat * norm2(before)) return false;
    }
    if (shared != 2) return false;
    const std::vector<std::int32_t> a = neighbours(v), b = neighbours(u);
    std::vector<std::int32_t> common;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
    return common.size() == 2;
  }

  void move(std::int32_t v, std::int32_t u) {
    for (const std::int32_t f : std::exchange(around_[v], {})) {
      Triangle& face = mesh_.faces[f];
      if (std::find(face.begin(), face.end(), u) == face.end()) {
        std::replace(face.begin(), face.end(), v, u);
        around_[u].push_back(f);
        continue;
      }
      for (const std::int32_t w : face)
        if (w != v) around_[w].erase(std::find(around_[w].begin(), around_[w].end(), f));
      face = {-1, -1, -1};
    }
  }

  Mesh& mesh_;
  std::vector<std::vector<std::int32_t>> around_;  // the faces at each vertex
};

}  // namespace

void collapse_flat(Mesh& mesh, const std::vector<std::int32_t>& vertices) {
  Collapser collapser(mesh);
  std::vector<std::int32_t> left = vertices;
  for (std::size_t before = left.size() + 1; left.size() < before;) {  // one may free another
    before = left.size();
    poll_stop();
    left.erase(std::remove_if(left.begin(), left.end(), [&](std::int32_t v) { return collapser.collapse(v); }),
               left.end());
  }
  collapser.compact();
}

}  // namespace rlacd
