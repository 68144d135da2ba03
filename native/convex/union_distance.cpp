#include "convex/union_distance.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "convex/lying.hpp"
#include "convex/polygon.hpp"
#include "core/stop.hpp"
#include "surface/weld.hpp"

namespace rlacd {
namespace {

// A facet cut into more pieces than this is left whole.
constexpr std::size_t kMostPieces = 4096;

// Two facets face the same way when the angle between them is below 60 degrees.
constexpr double kSameWay = 0.5;

using Offsets = std::vector<double>;  // of facet planes, instead of their own, and padded like those

// Distance to a surface; the witnesses are its triangles, by their slots.
class SurfaceField {
 public:
  explicit SurfaceField(const Bvh& bvh) : bvh_(bvh) {}

  Sample at(Vec3 p, std::int32_t hint, double enough) const {
    const Bvh::Hit hit = bvh_.closest(p, hint, enough);
    return {std::sqrt(hit.distance2), hit.slot};
  }
  double from(std::int32_t slot, Vec3 p) const { return bvh_.distance(slot, p); }
  double lying(const Corners& t) const { return lying_in(t, bvh_); }

 private:
  const Bvh& bvh_;
};

// Keeps only its buffers between calls: many small polygons would otherwise allocate them again and again.
class Clipper {
 public:
  // Replaces every polygon by its part outside the convex polytope of the planes with these offsets. A polygon that
  // does not meet it stays whole.
  void subtract(std::vector<Polygon>& polygons, const ConvexPlanes& planes, const Offsets& offsets) {
    left_.clear();
    for (Polygon& polygon : polygons) {
      if (is_separated(polygon, planes, offsets)) {
        left_.push_back(std::move(polygon));
        continue;
      }
      cut_off_.clear();
      rest_ = polygon;
      auto lies = Lies::kBelow;
      for (std::size_t k = 0; k < crossed_.size() && lies != Lies::kAbove; ++k) {
        const Vec3 normal = planes.normal(crossed_[k]);
        const auto height = [normal, offset = offsets[crossed_[k]]](Vec3 p) {
          const double h = dot(normal, p) - offset;
          return std::fabs(h) <= kRounding ? 0.0 : h;  // no clipped polygon is thinner than rounding
        };
        lies = split(rest_, height, inside_, outside_);
        if (lies != Lies::kAcross) continue;
        rest_.swap(inside_);
        cut_off_.push_back(outside_);
      }
      if (lies == Lies::kAbove)
        left_.push_back(std::move(polygon));
      else
        std::move(cut_off_.begin(), cut_off_.end(), std::back_inserter(left_));
    }
    polygons.swap(left_);
  }

 private:
  // Whether a single half-space shows that a polygon does not reach into the intersection; if not, the planes that the
  // polygon crosses are stored in `crossed_`.
  RLACD_WIDE bool is_separated(const Polygon& polygon, const ConvexPlanes& planes, const Offsets& offsets) {
    const double *x = planes.x(), *y = planes.y(), *z = planes.z();
    crossed_.clear();
    for (std::size_t start = 0; start < planes.size(); start += ConvexPlanes::kBlock) {
      double least[ConvexPlanes::kBlock], most[ConvexPlanes::kBlock];  // heights of the corners above each plane
      std::fill(least, least + ConvexPlanes::kBlock, kInfinity);
      std::fill(most, most + ConvexPlanes::kBlock, -kInfinity);
      for (const Vec3 p : polygon)
        for (std::size_t i = 0; i < ConvexPlanes::kBlock; ++i) {
          const std::size_t k = start + i;
          const double height = x[k] * p.x + y[k] * p.y + z[k] * p.z - offsets[k];
          least[i] = least[i] < height ? least[i] : height;
          most[i] = most[i] > height ? most[i] : height;
        }
      for (std::size_t i = 0; i < ConvexPlanes::kBlock; ++i) {
        if (least[i] >= -kRounding) return true;
        if (most[i] > kRounding) crossed_.push_back(static_cast<std::int32_t>(start + i));
      }
    }
    return false;
  }

  std::vector<std::int32_t> crossed_;
  std::vector<Polygon> left_, cut_off_;
  Polygon rest_, inside_, outside_;
};

// Polygons merged into one mesh, in which equal corners are one vertex: its distance is computed once.
class Gathering {
 public:
  void add(const Polygon& polygon) {
    const auto first = static_cast<std::int32_t>(soup_.vertices.size());
    soup_.vertices.insert(soup_.vertices.end(), polygon.begin(), polygon.end());
    for (auto i = static_cast<std::int32_t>(2); i < static_cast<std::int32_t>(polygon.size()); ++i)
      soup_.faces.push_back({first, first + i - 1, first + i});
  }
  Mesh take() {
    const std::vector<std::int32_t> first = first_in_place(soup_.vertices);
    Mesh mesh;
    Renumbered numbered(soup_.vertices, mesh.vertices);
    for (const std::int32_t v : first) numbered(v);
    for (const auto& [a, b, c] : soup_.faces) mesh.faces.push_back(numbered({first[a], first[b], first[c]}));
    return mesh;
  }

 private:
  Mesh soup_;
};

}  // namespace

HullUnion::HullUnion(std::vector<std::shared_ptr<ConvexBody>> hulls, int threads) : members_(std::move(hulls)) {
  parallel_for(members_.size(), members_.size() < 8 ? 1 : threads, [&](std::size_t i) { members_[i]->planes(); });
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
      if (!(members_[k]->box().distance2(p) < best.value * best.value)) continue;
      const double distance = std::max(0.0, members_[k]->distance(p, best.value));
      if (distance < best.value) best = {distance, static_cast<std::int32_t>(k)};
    }
    return best;
  }
  double from(std::int32_t hull, Vec3 p) const { return std::max(0.0, members_[hull]->distance(p)); }
  double lying(const Corners&) const { return kInfinity; }  // what is inside has been clipped off

 private:
  const std::vector<std::shared_ptr<ConvexBody>>& members_;
};

double HullUnion::distance(Vec3 p) const { return HullField(*this).at(p, -1, 0).value; }

HullUnion::Exposed HullUnion::exposed(double gap, int threads) const {
  struct Facet {
    std::vector<Polygon> pieces;
    bool resolved = true;
  };
  std::vector<std::vector<Facet>> facets(members_.size());
  parallel_for(members_.size(), threads, [&](std::size_t own) {
    const Mesh& mesh = members_[own]->mesh();
    Clipper clipper;
    for (const Triangle& face : mesh.faces) {
      poll_stop();
      const Corners corner = corners_of(mesh, face);
      const Vec3 normal = normalized(long_normal(corner));
      const Box box = Box::of(corner);
      Facet& facet = facets[own].emplace_back();
      facet.pieces = {{corner.begin(), corner.end()}};
      for (std::size_t m = 0; m < members_.size() && !facet.pieces.empty(); ++m) {
        if (m == own || !box.meets(members_[m]->box(), gap)) continue;
        // If another hull's facet faces the other way (or across), the hull is grown by the gap: a touching facet is
        // covered. If it faces the same way, the hull is shrunk by less than that: of two facets in one plane neither
        // covers the other, and of two hulls on both sides of a plane across this facet one always covers it.
        const ConvexPlanes& planes = members_[m]->planes();
        Offsets offsets = planes.offsets();
        for (std::size_t i = 0; i < offsets.size(); ++i) {
          const double same_way = planes.x()[i] * normal.x + planes.y()[i] * normal.y + planes.z()[i] * normal.z;
          offsets[i] += same_way >= kSameWay ? -0.25 * gap : gap;
        }
        clipper.subtract(facet.pieces, planes, offsets);
        if (facet.pieces.size() > kMostPieces) {
          facet.resolved = false;
          break;
        }
      }
    }
  });

  Gathering resolved, unresolved;
  for (const std::vector<Facet>& own : facets)
    for (const Facet& facet : own)
      for (const Polygon& piece : facet.pieces) (facet.resolved ? resolved : unresolved).add(piece);
  return {resolved.take(), unresolved.take()};
}

Greatest HullUnion::over(const Bvh& surface, const Goal& goal, double gap, int threads) const {
  const Exposed found = exposed(gap, threads);
  Greatest over = maximize(SurfaceField(surface), found.exposed, goal, threads);
  if (over.upper <= goal.pass) over.upper = tightened(SurfaceField(surface), found.exposed, over);
  if (!found.unresolved.faces.empty()) {
    const Greatest most = maximize(SurfaceField(surface), found.unresolved, goal, threads);
    if (most.upper > over.upper) over.upper = most.upper, over.at = most.at;
  }
  return over;
}

Greatest HullUnion::under(const Mesh& surface, const Goal& goal, int threads) const {
  if (members_.empty()) return {{kInfinity, kInfinity}, {}};
  // Planes are moved out, so that the hulls on both sides of a cut leave no rounding slivers between them. The material
  // lost lies at most this far beyond every facet's plane.
  std::vector<Offsets> grown;
  for (const auto& member : members_)
    for (double& offset : grown.emplace_back(member->planes().offsets())) offset += kHair;

  std::vector<std::vector<Polygon>> outside(surface.faces.size());
  const auto clip = [&](std::size_t f) {
    poll_stop();
    thread_local Clipper clipper;
    const Corners corner = corners_of(surface, surface.faces[f]);
    const Box box = Box::of(corner);
    outside[f] = {{corner.begin(), corner.end()}};
    for (std::size_t m = 0; m < members_.size(); ++m) {
      if (!box.meets(members_[m]->box(), kHair)) continue;
      if (outside[f].size() > kMostPieces) break;  // uncut pieces are not wrong here, only more work
      clipper.subtract(outside[f], members_[m]->planes(), grown[m]);
    }
  };
  parallel_for(outside.size(), threads, clip, kQuick);

  Gathering left;
  for (const std::vector<Polygon>& polygons : outside)
    for (const Polygon& polygon : polygons) left.add(polygon);
  return maximize(HullField(*this), left.take(), goal, threads);
}

}  // namespace rlacd
