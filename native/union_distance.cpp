#include "union_distance.hpp"

#include "clip.hpp"
#include "surface_field.hpp"

namespace rlacd {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Planes are moved out by this before a triangle of the surface is clipped by them, so that the hulls on both sides of
// a cut leave no slivers of rounding between them. What is lost is at most this far beyond every facet's plane.
constexpr double kInsideSlack = 1e-9;

// A facet in more pieces than this is left as it is.
constexpr std::size_t kMostPieces = 4096;

// Two facets face the same way when the angle between them is below 60 degrees.
constexpr double kSameWay = 0.5;

bool overlap(const Box& a, const Box& b, double slack) {
  for (int axis = 0; axis < 3; ++axis)
    if (a.lower[axis] > b.upper[axis] + slack || b.lower[axis] > a.upper[axis] + slack) return false;
  return true;
}

Box box_of(const Corners& corner) {
  Box box;
  for (const Vec3 p : corner) box.extend(p);
  return box;
}

double distance2_to_box(const Box& box, Vec3 p) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double d = std::max({box.lower[axis] - p[axis], p[axis] - box.upper[axis], 0.0});
    sum += d * d;
  }
  return sum;
}

void append(Mesh& mesh, const Polygon& polygon) {
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), polygon.begin(), polygon.end());
  for (std::int32_t i = 2; i < static_cast<std::int32_t>(polygon.size()); ++i)
    mesh.faces.push_back({first, first + i - 1, first + i});
}

}  // namespace

HullUnion::Member::Member(Mesh hull) : mesh(std::move(hull)), planes(mesh), bvh(mesh) {
  for (const Triangle& face : mesh.faces)
    for (const std::int32_t corner : face) box.extend(mesh.vertices[corner]);
}

double HullUnion::Member::distance(Vec3 p, double enough) const {
  // The farthest facet plane that p is beyond is no farther than the hull.
  const double beyond = -planes.nearest(p).depth;
  if (beyond <= 0) return 0;
  return beyond >= enough ? beyond : std::sqrt(bvh.closest(p).distance2);
}

HullUnion::HullUnion(std::vector<Mesh> hulls, int threads) : members_(hulls.size()) {
  parallel_for(hulls.size(), hulls.size() < 8 ? 1 : threads,
               [&](std::size_t i) { members_[i] = std::make_unique<Member>(std::move(hulls[i])); });
}

double HullUnion::distance(Vec3 p) const {
  double best = kInfinity;
  for (const auto& member : members_)
    if (distance2_to_box(member->box, p) < best * best) best = std::min(best, member->distance(p, best));
  return best;
}

// Distance to the union; the witnesses are the hulls.
class HullField {
 public:
  explicit HullField(const HullUnion& hulls) : members_(hulls.members_) {}

  Sample at(Vec3 p, std::int32_t hint, double enough) const {
    Sample best{kInfinity, -1};
    if (hint >= 0) best = {from(hint, p), hint};
    for (std::size_t k = 0; k < members_.size() && best.value > enough; ++k) {
      if (static_cast<std::int32_t>(k) == hint) continue;
      if (!(distance2_to_box(members_[k]->box, p) < best.value * best.value)) continue;
      const double distance = members_[k]->distance(p, best.value);
      if (distance < best.value) best = {distance, static_cast<std::int32_t>(k)};
    }
    return best;
  }
  double from(std::int32_t hull, Vec3 p) const { return members_[hull]->distance(p, kInfinity); }

 private:
  const std::vector<std::unique_ptr<HullUnion::Member>>& members_;
};

HullUnion::Exposed HullUnion::exposed(double gap, int threads) const {
  struct Facet {
    std::size_t member;
    Corners corner;
    std::vector<Polygon> pieces;
    bool resolved = true;
  };
  std::vector<Facet> facets;
  for (std::size_t m = 0; m < members_.size(); ++m)
    for (const Triangle& face : members_[m]->mesh.faces) facets.push_back({m, corners_of(members_[m]->mesh, face), {}});

  parallel_for(facets.size(), threads, [&](std::size_t f) {
    Facet& facet = facets[f];
    const Vec3 normal = normalized(cross(facet.corner[1] - facet.corner[0], facet.corner[2] - facet.corner[0]));
    const Box box = box_of(facet.corner);
    facet.pieces = {{facet.corner.begin(), facet.corner.end()}};
    std::vector<HalfSpace> halves;
    for (std::size_t m = 0; m < members_.size() && !facet.pieces.empty(); ++m) {
      if (m == facet.member || !overlap(box, members_[m]->box, gap)) continue;
      // Where another hull's facet faces the other way (or across), the hull is grown by the gap: a touching facet is
      // covered. Where it faces the same way, the hull is shrunk by less than that: of two facets in one plane neither
      // covers the other, and of two hulls on both sides of a plane across this facet one always covers it.
      const ConvexPlanes& planes = members_[m]->planes;
      halves.clear();
      for (std::int32_t i = 0; i < static_cast<std::int32_t>(planes.size()); ++i) {
        const bool same_way = dot(planes.normal(i), normal) >= kSameWay;
        halves.push_back({planes.normal(i), planes.offset(i) + (same_way ? -0.25 * gap : gap)});
      }
      subtract(facet.pieces, halves);
      if (facet.pieces.size() > kMostPieces) {
        facet.resolved = false;
        break;
      }
    }
  });

  Exposed result;
  for (const Facet& facet : facets)
    for (const Polygon& piece : facet.pieces) append(facet.resolved ? result.exposed : result.unresolved, piece);
  return result;
}

Interval HullUnion::over(const Bvh& surface, double tolerance, double gap, int threads) const {
  const Exposed found = exposed(gap, threads);
  Interval over = maximize_in_waves(SurfaceField(surface), found.exposed, tolerance, threads);
  if (!found.unresolved.faces.empty()) {
    const Interval most = maximize_in_waves(SurfaceField(surface), found.unresolved, tolerance, threads);
    over.upper = std::max(over.upper, most.upper);
  }
  return over;
}

Interval HullUnion::under(const Mesh& surface, double tolerance, int threads) const {
  if (members_.empty()) return {kInfinity, kInfinity};
  std::vector<std::vector<HalfSpace>> grown(members_.size());
  for (std::size_t m = 0; m < members_.size(); ++m)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(members_[m]->planes.size()); ++i)
      grown[m].push_back({members_[m]->planes.normal(i), members_[m]->planes.offset(i) + kInsideSlack});

  std::vector<std::vector<Polygon>> outside(surface.faces.size());
  constexpr std::size_t kChunk = 64;
  const std::size_t count = surface.faces.size();
  parallel_for((count + kChunk - 1) / kChunk, threads, [&](std::size_t chunk) {
    std::vector<std::size_t> near;
    std::size_t last = members_.size();  // the hull that covered the face before this one
    for (std::size_t f = chunk * kChunk; f < std::min(count, (chunk + 1) * kChunk); ++f) {
      const Corners corner = corners_of(surface, surface.faces[f]);
      const Box box = box_of(corner);
      const auto is_covered_by = [&](std::size_t m) {
        return overlap(box, members_[m]->box, kInsideSlack) && std::all_of(corner.begin(), corner.end(), [&](Vec3 p) {
                 return members_[m]->planes.nearest(p).depth >= -kInsideSlack;
               });
      };
      if (last < members_.size() && is_covered_by(last)) continue;
      last = 0;
      while (last < members_.size() && !is_covered_by(last)) ++last;
      if (last < members_.size()) continue;
      near.clear();
      for (std::size_t m = 0; m < members_.size(); ++m)
        if (overlap(box, members_[m]->box, kInsideSlack)) near.push_back(m);
      outside[f] = {{corner.begin(), corner.end()}};
      for (const std::size_t m : near) {
        if (outside[f].size() > kMostPieces) break;  // uncut pieces are in no way wrong here, only more work
        subtract(outside[f], grown[m]);
      }
    }
  });

  Mesh left;
  for (const std::vector<Polygon>& polygons : outside)
    for (const Polygon& polygon : polygons) append(left, polygon);
  return maximize_in_waves(HullField(*this), left, tolerance, threads);
}

}  // namespace rlacd
