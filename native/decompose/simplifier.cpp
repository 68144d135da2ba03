#include "decompose/simplifier.hpp"

#include <cmath>
#include <cstring>

#include "core/parallel.hpp"
#include "core/random.hpp"
#include "core/stop.hpp"

namespace rlacd {
namespace {

// More faces than this are reduced in sweeps. One collapses only the cheapest edges, one in this many of all, so that
// flat regions are swept again before features are touched.
constexpr std::size_t kLarge = 12'000, kOneIn = 3;
// Sweeps that remove no more than one face in this many have run out of edges.
constexpr std::size_t kHardlyAny = 50;
// Edges drawn for each collapse: few while there are many faces, and more as each collapse matters more.
constexpr std::size_t kFewChoices = 6, kMostChoices = 150, kChoicesTimesFaces = 400'000;
// Moving along a flat surface costs nothing: this share of a quadric's trace holds points near the middle of the edge.
constexpr double kStiffness = 1e-5;
constexpr double kFarthest = 1;           // a point moves at most this many lengths of its edge from its middle
constexpr double kTurned = 0.3;           // least cosine of the angle by which a collapse may turn a face
constexpr std::size_t kMostFailures = 3;  // draws for each face left without an edge that can be collapsed
constexpr std::size_t kFewest = 4;

// Costs are ranked by their exponent and the first four bits of their mantissa.
constexpr std::uint16_t kRanks = 1 << 15;
std::uint16_t rank_of(double cost) {
  if (!(cost > 0)) return 0;
  std::uint64_t bits;
  std::memcpy(&bits, &cost, sizeof bits);
  return static_cast<std::uint16_t>(bits >> 48);
}

}  // namespace

void Simplifier::Quadric::add_plane(Vec3 n, double offset, double weight) {
  xx += weight * n.x * n.x;
  xy += weight * n.x * n.y;
  xz += weight * n.x * n.z;
  yy += weight * n.y * n.y;
  yz += weight * n.y * n.z;
  zz += weight * n.z * n.z;
  b = b - (weight * offset) * n;
  c += weight * offset * offset;
}

void Simplifier::Quadric::add(const Quadric& other) {
  xx += other.xx;
  xy += other.xy;
  xz += other.xz;
  yy += other.yy;
  yz += other.yz;
  zz += other.zz;
  b = b + other.b;
  c += other.c;
}

Vec3 Simplifier::Quadric::times(Vec3 x) const {
  return {xx * x.x + xy * x.y + xz * x.z, xy * x.x + yy * x.y + yz * x.z, xz * x.x + yz * x.y + zz * x.z};
}

double Simplifier::Quadric::at(Vec3 x) const { return dot(x, times(x)) + 2 * dot(b, x) + c; }

Vec3 Simplifier::Quadric::least_near(Vec3 x) const {
  const double stiffness = kStiffness * (xx + yy + zz);
  const double a = xx + stiffness, e = yy + stiffness, i = zz + stiffness;
  const Vec3 row0 = {e * i - yz * yz, xz * yz - xy * i, xy * yz - xz * e};
  const double determinant = a * row0.x + xy * row0.y + xz * row0.z;
  if (!(determinant > 0)) return x;
  const Vec3 row1 = {row0.y, a * i - xz * xz, xy * xz - a * yz};
  const Vec3 row2 = {row0.z, row1.z, a * e - xy * xy};
  const Vec3 slope = times(x) + b;
  return x - (1 / determinant) * Vec3{dot(row0, slope), dot(row1, slope), dot(row2, slope)};
}

Simplifier::Simplifier(const Mesh& mesh)
    : points_(mesh.vertices),
      quadrics_(mesh.vertices.size()),
      faces_(mesh.faces),
      alive_(mesh.faces.size()),
      place_(mesh.faces.size()),
      first_(mesh.vertices.size(), -1),
      last_(mesh.vertices.size(), -1),
      next_(3 * mesh.faces.size(), -1),
      mark_(mesh.vertices.size(), 0) {
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    poll_stop(f);
    alive_[f] = place_[f] = static_cast<std::int32_t>(f);
    const auto [a, b, c] = faces_[f];
    const Vec3 normal = long_normal({points_[a], points_[b], points_[c]});
    const double length = norm(normal);
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = faces_[f][k], corner = static_cast<std::int32_t>(3 * f) + k;
      if (length > 0) quadrics_[v].add_plane((1 / length) * normal, dot(normal, points_[a]) / length, length / 6);
      if (first_[v] < 0)
        first_[v] = corner;
      else
        next_[last_[v]] = corner;
      last_[v] = corner;
    }
  }
}

void Simplifier::reduce(std::size_t count, int threads) {
  const std::size_t few = std::max(count, kLarge);
  while (size() > few) {
    const std::size_t before = size();
    sweep(few, threads);
    if (before - size() <= before / kHardlyAny) break;
  }
  collapse_drawn(count);
}

// Collapses the cheap edges until at most `count` faces are left, in the order of the faces: their memory is then near.
// Costs are those before the sweep, so no vertex takes part twice.
void Simplifier::sweep(std::size_t count, int threads) {
  std::vector<char> has_moved(points_.size(), 0);
  std::size_t steps = 0;
  for (const std::int32_t corner : cheap_edges(threads)) {
    poll_stop(++steps);
    if (size() <= count) return;
    const Triangle& face = faces_[corner / 3];
    const std::int32_t from = face[corner % 3], to = face[(corner + 1) % 3];
    if (has_moved[from] || has_moved[to] || !collapse(priced(from, to))) continue;
    has_moved[from] = has_moved[to] = 1;
  }
}

// The cheapest edges, about one in `kOneIn`, as the corner 3 f + k they start from.
std::vector<std::int32_t> Simplifier::cheap_edges(int threads) const {
  std::vector<std::uint16_t> ranks(3 * faces_.size(), kRanks);  // of the edges, by corner
  const auto set_ranks = [&](std::size_t f) {
    if (place_[f] < 0) return;
    const Triangle& face = faces_[f];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t from = face[k], to = face[(k + 1) % 3];
      if (from < to) ranks[3 * f + k] = rank_of(priced(from, to).cost);
    }
  };
  parallel_for(faces_.size(), threads, set_ranks, kQuick);
  std::vector<std::size_t> of_rank(kRanks + 1, 0);
  for (const std::uint16_t rank : ranks) ++of_rank[rank];
  std::size_t wanted = (ranks.size() - of_rank[kRanks]) / kOneIn, dearest = 0;
  for (; dearest + 1 < kRanks && of_rank[dearest] < wanted; ++dearest) wanted -= of_rank[dearest];
  std::vector<std::int32_t> cheap;
  for (std::size_t corner = 0; corner < ranks.size(); ++corner)
    if (ranks[corner] <= dearest) cheap.push_back(static_cast<std::int32_t>(corner));
  return cheap;
}

void Simplifier::collapse_drawn(std::size_t count) {
  std::size_t failures = 0, steps = 0;
  while (size() > std::max(count, kFewest) && failures < kMostFailures * size()) {
    poll_stop(++steps);
    candidates_.clear();
    const std::size_t choices = std::clamp(kChoicesTimesFaces / size(), kFewChoices, kMostChoices);
    for (std::size_t k = 0; k < choices; ++k) candidates_.push_back(random_edge());
    // Cheap edges that cannot be collapsed would be drawn again and again.
    std::sort(candidates_.begin(), candidates_.end(),
              [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    const bool done =
        std::any_of(candidates_.begin(), candidates_.end(), [this](const auto& c) { return collapse(c); });
    failures = done ? 0 : failures + choices;
  }
}

Mesh Simplifier::mesh() const {
  Mesh result;
  Renumbered numbered(points_, result.vertices);
  for (std::size_t f = 0; f < faces_.size(); ++f)
    if (place_[f] >= 0) result.faces.push_back(numbered(faces_[f]));
  return result;
}

Simplifier::Candidate Simplifier::random_edge() {
  const std::uint64_t number = random_bits(0, drawn_++);
  const Triangle& face = faces_[alive_[static_cast<std::size_t>(number >> 8) % alive_.size()]];
  const auto k = static_cast<std::size_t>(number % 3);
  return priced(face[k], face[(k + 1) % 3]);
}

// The collapse of an edge to the best point, and what it costs.
Simplifier::Candidate Simplifier::priced(std::int32_t from, std::int32_t to) const {
  Candidate edge;
  edge.from = from;
  edge.to = to;
  Quadric both = quadrics_[from];
  both.add(quadrics_[to]);
  const Vec3 middle = 0.5 * (points_[from] + points_[to]);
  edge.point = both.least_near(middle);
  if (norm2(edge.point - middle) > kFarthest * kFarthest * norm2(points_[to] - points_[from])) {
    edge.point = middle;
    for (const std::int32_t end : {from, to})
      if (both.at(points_[end]) < both.at(edge.point)) edge.point = points_[end];
  }
  edge.cost = both.at(edge.point);
  return edge;
}

// Lists the faces around a vertex that are left, and forgets the others.
void Simplifier::gather(std::int32_t vertex, std::vector<std::int32_t>& faces) {
  faces.clear();
  std::int32_t before = -1;
  for (std::int32_t corner = first_[vertex]; corner >= 0; corner = next_[corner]) {
    if (place_[corner / 3] < 0) continue;
    if (before < 0)
      first_[vertex] = corner;
    else
      next_[before] = corner;
    before = corner;
    faces.push_back(corner / 3);
  }
  if (before >= 0) {
    next_[before] = -1;
    last_[vertex] = before;
  } else {
    first_[vertex] = last_[vertex] = -1;
  }
}

bool Simplifier::turns_over(const std::vector<std::int32_t>& faces, std::int32_t vertex, std::int32_t other,
                            Vec3 point) const {
  for (const std::int32_t f : faces) {
    const Triangle& face = faces_[f];
    Corners corner, moved;
    bool vanishes = false;
    for (int k = 0; k < 3; ++k) {
      vanishes |= face[k] == other;
      corner[k] = points_[face[k]];
      moved[k] = face[k] == vertex ? point : corner[k];
    }
    if (vanishes) continue;
    const Vec3 before = long_normal(corner), after = long_normal(moved);
    const double product = dot(before, after);
    // A face without an area may become anything that has one.
    if (!(norm2(after) > 0) || product * std::fabs(product) < kTurned * kTurned * norm2(before) * norm2(after))
      return true;
  }
  return false;
}

// The link condition: the two vertices have no common neighbours but those opposite their edge.
bool Simplifier::keeps_topology(std::int32_t from, std::int32_t to) {
  ++stamp_;
  for (const std::int32_t f : around_from_)
    for (const std::int32_t v : faces_[f]) mark_[v] = stamp_;
  const std::int32_t common = ++stamp_;
  int shared_vertices = 0, shared_faces = 0;
  for (const std::int32_t f : around_to_) {
    bool is_shared = false;
    for (const std::int32_t v : faces_[f]) {
      is_shared |= v == from;
      if (v == from || v == to || mark_[v] != common - 1) continue;
      mark_[v] = common;
      ++shared_vertices;
    }
    shared_faces += is_shared ? 1 : 0;
  }
  return shared_vertices == 2 && shared_faces == 2;
}

bool Simplifier::collapse(const Candidate& edge) {
  gather(edge.from, around_from_);
  gather(edge.to, around_to_);
  if (!keeps_topology(edge.from, edge.to) || turns_over(around_from_, edge.from, edge.to, edge.point) ||
      turns_over(around_to_, edge.to, edge.from, edge.point))
    return false;
  for (const std::int32_t f : around_to_) {
    bool vanishes = false;
    for (std::int32_t& v : faces_[f]) {
      vanishes |= v == edge.from;
      if (v == edge.to) v = edge.from;
    }
    if (vanishes) remove(f);
  }
  points_[edge.from] = edge.point;
  quadrics_[edge.from].add(quadrics_[edge.to]);
  next_[last_[edge.from]] = first_[edge.to];
  last_[edge.from] = last_[edge.to];
  first_[edge.to] = last_[edge.to] = -1;
  return true;
}

void Simplifier::remove(std::int32_t face) {
  const std::int32_t at = place_[face];
  alive_[at] = alive_.back();
  place_[alive_[at]] = at;
  alive_.pop_back();
  place_[face] = -1;
}

}  // namespace rlacd
