#include "solid/convex_clip.hpp"

#include <algorithm>
#include <tuple>
#include <unordered_map>

#include "convex/polytope.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

// Planes are moved out by one to two times this: far above rounding, far below any distance that matters. If crossings
// contradict each other, it is tried again with larger ones.
constexpr double kNudge = 1e-8;
constexpr double kLarger[] = {1, 3.3, 11};
constexpr double kInside = 0.5;
// Corners are in the solid once or not at all; in spots where noise makes it overlap itself they may be in it twice, or
// less than not at all.
constexpr std::int32_t kLeastState = -1, kMostState = 2;

// What made a corner: a vertex of the solid (v, -1, -1), an edge of it and a facet (v, w, facet) with v < w, a face of
// it and two facets (~face, facet, facet), or a corner of the polytope (kOwn, corner, 0).
using Key = std::tuple<std::int32_t, std::int32_t, std::int32_t>;
constexpr std::int32_t kOwn = std::numeric_limits<std::int32_t>::min();

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t h = static_cast<std::uint32_t>(std::get<0>(key));
    h = (h ^ (static_cast<std::uint64_t>(static_cast<std::uint32_t>(std::get<1>(key))) << 32)) * 0x9E3779B97F4A7C15u;
    h = (h ^ (h >> 29) ^ static_cast<std::uint32_t>(std::get<2>(key))) * 0xBF58476D1CE4E5B9u;
    return static_cast<std::size_t>(h ^ (h >> 32));
  }
};

using Group = std::vector<std::int32_t>;
constexpr std::int32_t kNone = -1;

class Clip {
 public:
  Clip(const Mesh& solid, const Surface& surface, Polytope polytope)
      : solid_(solid),
        surface_(surface),
        polytope_(std::move(polytope)),
        number_of_vertex_(solid.vertices, result_.mesh.vertices) {
    crossings_.resize(polytope_.edges.size());
    paths_.resize(polytope_.facets.size());
  }

  std::optional<ConvexClip> run() {
    for (std::size_t i = 0; i < polytope_.facets.size(); ++i) crossing_.push_back(static_cast<std::int32_t>(i));
    visit(0, 0);
    if (is_contradictory_ || !find_states() || !add_edges() || !link()) return std::nullopt;
    return std::move(result_);
  }

 private:
  struct Crossing {
    double at;  // along the edge
    std::int32_t vertex;
  };
  struct Crossings {
    std::vector<Crossing> entries, exits;  // into and out of the solid, along the edge
  };
  // A corner of the polygon that is left of a face; `side` is what the polygon's side to the next corner lies on: a
  // facet, or side ~side of the face.
  struct Corner {
    Vec3 point;
    Key key;
    std::int32_t side;
  };

  // Clips all below a node of the solid's tree. The facets that cross it are crossing_[first, ...).
  void visit(std::int32_t at, std::size_t first) {
    poll_stop();
    const Bvh::Node& node = surface_.bvh().nodes()[at];
    const std::size_t last = crossing_.size();
    for (int side = 0; side < 2; ++side) {
      const Box& box = node.box[side];
      if (box.is_empty()) continue;
      const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower);
      bool is_outside = false;
      for (std::size_t i = first; i < last && !is_outside; ++i) {
        const std::int32_t facet = crossing_[i];
        const double depth = polytope_.facets[facet].depth(middle);
        // Rounding may only make a box cross.
        const double reach = reach_along(polytope_.facets[facet].normal, half) + 1e-12;
        is_outside = depth < -reach;
        if (depth < reach) crossing_.push_back(facet);
      }
      if (!is_outside && node.child[side] >= 0)
        visit(node.child[side], last);
      else if (!is_outside)
        clip_leaf(~node.child[side], node.leaf_size[side], last);
      crossing_.resize(last);
    }
  }

  void clip_leaf(std::int32_t slot, std::int32_t count, std::size_t first) {
    for (std::int32_t k = 0; k < count; ++k) {
      const std::int32_t face = surface_.bvh().face(slot + k);
      if (first == crossing_.size())
        keep(solid_.faces[face]);
      else
        clip(face, first);
    }
  }

  // A face of the solid that no facet crosses.
  void keep(const Triangle& face) {
    const Triangle numbered = number_of_vertex_(face);
    if (numbered[0] != numbered[1] && numbered[1] != numbered[2] && numbered[2] != numbered[0])
      result_.mesh.faces.push_back(numbered);
  }

  void clip(std::int32_t f, std::size_t first) {
    const Triangle& face = solid_.faces[f];
    polygon_.clear();
    for (int k = 0; k < 3; ++k) polygon_.push_back({solid_.vertices[face[k]], {face[k], kNone, kNone}, ~k});
    for (std::size_t i = first; i < crossing_.size(); ++i) {
      const std::int32_t facet = crossing_[i];
      depths_.clear();
      for (const Corner& corner : polygon_) depths_.push_back(polytope_.facets[facet].depth(corner.point));
      if (std::all_of(depths_.begin(), depths_.end(), [](double depth) { return depth >= 0; })) continue;
      kept_.clear();
      for (std::size_t k = 0; k < polygon_.size(); ++k) {
        const std::size_t next = (k + 1) % polygon_.size();
        if (depths_[k] >= 0) kept_.push_back(polygon_[k]);
        if ((depths_[k] >= 0) == (depths_[next] >= 0)) continue;
        Corner made = meet(f, polygon_[k], polygon_[next], depths_[k], depths_[next], facet);
        made.side = depths_[k] >= 0 ? facet : polygon_[k].side;
        kept_.push_back(made);
      }
      if (kept_.size() < 3) return;
      polygon_.swap(kept_);
    }
    emit();
  }

  // Where a facet crosses a side of the polygon.
  Corner meet(std::int32_t f, const Corner& from, const Corner& to, double at_from, double at_to, std::int32_t facet) {
    if (from.side >= 0) {
      const auto [low, high] = std::minmax(from.side, facet);
      const Vec3 point = from.point + (at_from / (at_from - at_to)) * (to.point - from.point);
      return {point, {~f, low, high}, kNone};
    }
    // From the whole edge and always in the same direction: the face on the other side has to find the same bits.
    const Triangle& face = solid_.faces[f];
    auto [v, w] = std::minmax(face[~from.side], face[(~from.side + 1) % 3]);
    const Vec3 p = solid_.vertices[v], q = solid_.vertices[w];
    const double at_p = polytope_.facets[facet].depth(p), at_q = polytope_.facets[facet].depth(q);
    return {p + (at_p / (at_p - at_q)) * (q - p), {v, w, facet}, kNone};
  }

  void emit() {
    numbers_.clear();
    for (const Corner& corner : polygon_) numbers_.push_back(number_of(corner.key, corner.point));
    for (std::size_t k = 2; k < polygon_.size(); ++k)
      if (numbers_[0] != numbers_[k - 1] && numbers_[k - 1] != numbers_[k] && numbers_[k] != numbers_[0])
        result_.mesh.faces.push_back({numbers_[0], numbers_[k - 1], numbers_[k]});
    for (std::size_t k = 0; k < polygon_.size(); ++k) {
      const std::size_t before = (k + polygon_.size() - 1) % polygon_.size(), next = (k + 1) % polygon_.size();
      const std::int32_t facet = polygon_[k].side, last = polygon_[before].side;
      if (facet < 0) continue;
      paths_[facet].push_back({numbers_[next], numbers_[k]});  // the cap lies on the other side
      if (last < 0) continue;
      // The face leaves the facet `last` here. Its cap's rim comes along the edge between the two to this corner, where
      // it enters the face's path: what is inside the solid ends here for who goes around `last`.
      const std::int32_t between = polytope_.edge_between(last, facet);
      if (between < 0) {
        is_contradictory_ = true;
        continue;
      }
      const Polytope::Edge& edge = polytope_.edges[between];
      const Vec3 from = polytope_.corners[edge.from], to = polytope_.corners[edge.to];
      Crossings& own = crossings_[between];
      (last == edge.left ? own.exits : own.entries).push_back({dot(polygon_[k].point - from, to - from), numbers_[k]});
    }
  }

  std::int32_t number_of(const Key& key, Vec3 point) {
    if (std::get<0>(key) >= 0 && std::get<1>(key) == kNone) return number_of_vertex_(std::get<0>(key));
    const auto [at, is_new] = numbers_by_key_.try_emplace(key, static_cast<std::int32_t>(result_.mesh.vertices.size()));
    if (is_new) result_.mesh.vertices.push_back(point);
    return at->second;
  }

  // Decides how often the solid holds each corner of the polytope: along an edge, every entry and exit changes it by 1.
  bool find_states() {
    const std::size_t count = polytope_.corners.size();
    std::vector<std::vector<std::pair<std::int32_t, std::int32_t>>> around(count);  // (other corner, change)
    for (std::size_t e = 0; e < crossings_.size(); ++e) {
      const Polytope::Edge& edge = polytope_.edges[e];
      const auto change = static_cast<std::int32_t>(crossings_[e].entries.size()) -
                          static_cast<std::int32_t>(crossings_[e].exits.size());
      around[edge.from].emplace_back(edge.to, change);
      around[edge.to].emplace_back(edge.from, -change);
    }
    constexpr std::int32_t kUnknown = std::numeric_limits<std::int32_t>::max();
    states_.assign(count, kUnknown);
    states_[0] = 0;
    Group waiting = {0};
    while (!waiting.empty()) {
      const std::int32_t at = waiting.back();
      waiting.pop_back();
      for (const auto& [other, change] : around[at]) {
        if (states_[other] == kUnknown) {
          states_[other] = states_[at] + change;
          waiting.push_back(other);
        } else if (states_[other] != states_[at] + change) {
          return false;
        }
      }
    }
    const auto [least, most] = std::minmax_element(states_.begin(), states_.end());
    if (*most == kUnknown) return false;
    const std::int32_t first = *most - *least > 1  ? winding_of_first()
                               : *most > *least    ? -*least
                               : first_is_inside() ? 1 - *least
                                                   : -*least;
    for (std::int32_t& state : states_) state += first;
    return std::all_of(states_.begin(), states_.end(),
                       [](std::int32_t state) { return kLeastState <= state && state <= kMostState; });
  }

  // The winding number of the first corner, from that of the corner farthest from the surface.
  std::int32_t winding_of_first() const {
    std::size_t best = 0;
    double farthest = -1;
    for (std::size_t c = 0; c < polytope_.corners.size(); ++c) {
      const double distance = surface_.bvh().closest(polytope_.corners[c]).distance2;
      if (distance > farthest) farthest = distance, best = c;
    }
    const double winding = surface_.winding().of_closed(polytope_.corners[best]);
    return static_cast<std::int32_t>(std::lround(winding)) - states_[best];
  }

  // Whether the polytope's corners are inside, if all are on the same side.
  bool first_is_inside() const {
    double widest = 0;
    bool is_inside = false;
    for (const Crossings& own : crossings_) {
      if (own.entries.empty()) continue;
      const auto before = [](const Crossing& a, const Crossing& b) { return a.at < b.at; };
      const double entry = std::min_element(own.entries.begin(), own.entries.end(), before)->at;
      const double exit = std::min_element(own.exits.begin(), own.exits.end(), before)->at;
      if (std::fabs(entry - exit) <= widest) continue;
      widest = std::fabs(entry - exit);
      is_inside = exit < entry;
    }
    if (widest > 0) return is_inside;
    // No edge crosses the solid: any point of one will do, the farthest from the surface best.
    double farthest = -1;
    Vec3 best = polytope_.corners[0];
    for (const Polytope::Edge& edge : polytope_.edges) {
      const Vec3 middle = 0.5 * (polytope_.corners[edge.from] + polytope_.corners[edge.to]);
      const double distance = surface_.bvh().closest(middle).distance2;
      if (distance > farthest) farthest = distance, best = middle;
    }
    return surface_.winding().of_closed(best) > kInside;
  }

  // Adds the parts of the polytope's edges that are inside the solid to the rims on both sides.
  bool add_edges() {
    for (std::size_t e = 0; e < crossings_.size(); ++e) {
      const Polytope::Edge& edge = polytope_.edges[e];
      Crossings& own = crossings_[e];
      const auto corner = [&](std::int32_t c) { return number_of({kOwn, c, 0}, polytope_.corners[c]); };
      constexpr double kFar = std::numeric_limits<double>::infinity();
      for (const auto& [c, at] : {std::pair(edge.from, -kFar), std::pair(edge.to, kFar)}) {
        const std::int32_t state = states_[c];
        for (std::int32_t k = 0; k < std::abs(state); ++k)
          ((c == edge.from) == (state > 0) ? own.entries : own.exits).push_back({at, corner(c)});
      }
      if (own.entries.size() != own.exits.size()) return false;
      const auto before = [](const Crossing& a, const Crossing& b) {
        return std::tie(a.at, a.vertex) < std::tie(b.at, b.vertex);
      };
      std::sort(own.entries.begin(), own.entries.end(), before);
      std::sort(own.exits.begin(), own.exits.end(), before);
      for (std::size_t k = 0; k < own.entries.size(); ++k) {
        paths_[edge.left].push_back({own.entries[k].vertex, own.exits[k].vertex});
        paths_[edge.right].push_back({own.exits[k].vertex, own.entries[k].vertex});
      }
    }
    return true;
  }

  // Joins the paths on every facet to loops.
  bool link() {
    for (std::size_t i = 0; i < paths_.size(); ++i) {
      auto& paths = paths_[i];
      paths.erase(std::remove_if(paths.begin(), paths.end(), [](const Edge& path) { return path[0] == path[1]; }),
                  paths.end());
      if (paths.empty()) continue;
      poll_stop();
      std::optional<Loops> loops = loops_of(std::move(paths));
      if (!loops) return false;
      ConvexClip::Section section{polytope_.facets[i].normal, std::move(*loops)};
      if (section.rims.empty() || fill(section)) continue;
      result_.sections.push_back(std::move(section));
    }
    return true;
  }

  // Closes sections that are triangles, or no wider than the planes were moved: facets that touch the solid's faces.
  bool fill(const ConvexClip::Section& section) {
    Vec3 twice_area{0, 0, 0};
    double length = 0;
    for (const auto& rim : section.rims)
      for (std::size_t k = 0; k < rim.size(); ++k) {
        const Vec3 p = result_.mesh.vertices[rim[k]], q = result_.mesh.vertices[rim[(k + 1) % rim.size()]];
        twice_area = twice_area + cross(p - result_.mesh.vertices[rim[0]], q - result_.mesh.vertices[rim[0]]);
        length += norm(q - p);
      }
    const bool is_triangle = section.rims.size() == 1 && section.rims[0].size() == 3;
    if (!is_triangle && norm(twice_area) > 4 * kNudge * length) return false;
    for (const auto& rim : section.rims)
      for (std::size_t k = 2; k < rim.size(); ++k) result_.mesh.faces.push_back({rim[0], rim[k - 1], rim[k]});
    return true;
  }

  const Mesh& solid_;
  const Surface& surface_;
  const Polytope polytope_;
  std::vector<Crossings> crossings_;      // of the polytope's edges
  std::vector<std::vector<Edge>> paths_;  // on its facets
  std::vector<std::int32_t> states_;      // how often the solid holds its corners
  bool is_contradictory_ = false;
  Group crossing_;  // the facets that cross the nodes on the way from the root, one group after the other
  std::vector<Corner> polygon_, kept_;
  std::vector<double> depths_;
  std::vector<std::int32_t> numbers_;
  ConvexClip result_;
  Renumbered number_of_vertex_;  // of the solid
  std::unordered_map<Key, std::int32_t, KeyHash> numbers_by_key_;
};

}  // namespace

std::optional<ConvexClip> clip_to_convex(const Mesh& solid, const Surface& surface, const ConvexBody& hull) {
  for (const double larger : kLarger) {
    std::optional<Polytope> polytope = in_general_position(hull, larger * kNudge);
    if (!polytope) continue;
    if (std::optional<ConvexClip> clip = Clip(solid, surface, std::move(*polytope)).run()) return clip;
  }
  return std::nullopt;
}

}  // namespace rlacd
