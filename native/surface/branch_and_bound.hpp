// The greatest value, over a surface, of a function that is a minimum of convex functions; certified.
//
// In:  triangles, and a *field*: f(x) = min over witnesses w of f_w(x), every f_w convex and 1-Lipschitz. Distance to a
//      set of convex objects (triangles, hulls) is such a function; so is depth under a set of planes.
//        Sample at(Vec3 p, int32 hint, double enough)  a witness with f_w(p) = f(p), or any with f_w(p) <= enough
//        double from(int32 witness, Vec3 p)            f_w(p)
//        double lying(Corners t)                       a bound on f over a triangle where f is 0, else infinity
// Out: an interval that holds the maximum, narrow enough for the goal, and where it is reached.
// How: branch and bound over the triangles: all that are open are halved at once at their longest edges, wave after
//      wave. A wave depends only on those before it, so nothing depends on the number of threads.
//      Lower bound: f at the corners.
//      Upper bound over a triangle: for weights l_w >= 0 that add up to 1, f <= sum l_w f_w, which is convex, so its
//      maximum over the triangle is at a corner. The bound is the least such number over every single witness and every
//      pair of the witnesses of the corners. A single witness closes a cell that lies in its own territory; a pair
//      closes one across the ridge between two, where single witnesses would need cells as small as the tolerance.
//      f_w is 1-Lipschitz, so the bound exceeds f at a corner by no more than the cell's size: halving always ends.
//      Where f is 0 over many witnesses, cells would have to be as small as the goal along all their ridges: the field
//      bounds those at once.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "core/geometry.hpp"
#include "core/parallel.hpp"
#include "core/stop.hpp"

namespace rlacd {

struct Interval {
  double lower = 0, upper = 0;
};

struct Sample {
  double value = 0;
  std::int32_t witness = -1;
};

struct SubTriangle {
  Corners corner;
  std::array<Sample, 3> sample;
  double upper = kInfinity;
};

struct Goal {
  double tolerance;         // stop once the interval is this narrow
  double pass = 0;          // values certainly no larger than this need not be resolved
  double rough = 0;         // nor values up to this be exact, in the interval's lower end
  double fail = kInfinity;  // stop once the maximum is certainly larger
};

// Cells examined before giving up with the interval reached so far; far above what real surfaces need.
constexpr std::size_t kMostCells = std::size_t{1} << 22;

// A witness within this share of the relevant distance is as good as the best one, and found sooner.
constexpr double kEnough = 0.5;

// min over l in [0, 1] of max over j of l a[j] + (1 - l) b[j]: the upper envelope of three lines is least at an end or
// where two of them cross.
inline double best_mixture(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  double best = std::min(std::max({a[0], a[1], a[2]}), std::max({b[0], b[1], b[2]}));
  for (int j = 0; j < 3; ++j) {
    const int k = j == 2 ? 0 : j + 1;
    const double slope = (a[j] - b[j]) - (a[k] - b[k]);
    if (slope == 0) continue;  // the lines are parallel
    const double l = (b[k] - b[j]) / slope;
    if (!(l > 0 && l < 1)) continue;
    double worst = 0;
    for (int i = 0; i < 3; ++i) worst = std::max(worst, l * a[i] + (1 - l) * b[i]);
    best = std::min(best, worst);
  }
  return best;
}

// A triangle is asked whether it lies where the field is 0 once its bound is so many times what need not be resolved:
// others are halved sooner.
constexpr double kWorth = 8;

template <class Field>
double upper_bound(const Field& field, const SubTriangle& cell) {
  std::array<double, 3> row[3];
  std::int32_t known[3];
  int rows = 0;
  for (const Sample& sample : cell.sample) {
    if (std::find(known, known + rows, sample.witness) != known + rows) continue;
    known[rows] = sample.witness;
    for (int j = 0; j < 3; ++j) row[rows][j] = field.from(sample.witness, cell.corner[j]);
    ++rows;
  }
  if (rows == 1) return std::max({row[0][0], row[0][1], row[0][2]});
  double best = kInfinity;
  for (int i = 0; i < rows; ++i)
    for (int k = i + 1; k < rows; ++k) best = std::min(best, best_mixture(row[i], row[k]));
  return best;
}

// The two halves of a cell, cut at the middle of its longest edge; corner 0 of both is the new point.
template <class Field>
std::array<SubTriangle, 2> bisect(const Field& field, const SubTriangle& cell, double enough) {
  const int from = longest_side(cell.corner), to = (from + 1) % 3, across = (from + 2) % 3;
  const Vec3 middle = 0.5 * (cell.corner[from] + cell.corner[to]);
  const Sample sample = field.at(middle, cell.sample[from].witness, enough);
  std::array<SubTriangle, 2> halves;
  for (int side = 0; side < 2; ++side) {
    const int kept = side == 0 ? from : to;
    halves[side].corner = {middle, cell.corner[across], cell.corner[kept]};
    halves[side].sample = {sample, cell.sample[across], cell.sample[kept]};
    halves[side].upper = std::min(cell.upper, upper_bound(field, halves[side]));
  }
  return halves;
}

// An interval around the greatest value, and where its lower end is reached; undefined where no value is above 0.
struct Greatest : Interval {
  Vec3 at{};
};

template <class Field>
Greatest maximize(const Field& field, const Mesh& mesh, const Goal& goal, int threads) {
  constexpr std::size_t kChunk = 128;
  const auto for_each = [&](std::size_t count, const auto& task) {
    parallel_for(count, count <= 3 * kChunk ? 1 : threads, task, kChunk);
  };

  Greatest found;
  found.upper = kInfinity;
  const auto learn = [&](const Sample& sample, Vec3 at, double exact_above) {
    if (sample.value > exact_above && sample.value > found.lower) found.lower = sample.value, found.at = at;
  };
  const auto enough = [&] { return kEnough * std::max(goal.rough, found.lower); };
  double dropped = 0;
  std::vector<Sample> at_vertex(mesh.vertices.size());
  std::vector<char> is_corner(mesh.vertices.size(), 0);
  for (const Triangle& face : mesh.faces)
    for (const std::int32_t corner : face) is_corner[corner] = 1;
  // A few corners first: they show what distance matters, so that most of the others need no exact answer, and a
  // witness that may be near.
  for (const std::size_t stride : {std::size_t{kChunk}, std::size_t{1}}) {
    const double exact_above = enough();
    for_each((at_vertex.size() + stride - 1) / stride, [&](std::size_t i) {
      const std::size_t v = i * stride;
      const std::int32_t hint = stride == 1 ? at_vertex[v - v % kChunk].witness : -1;
      if (is_corner[v] && (stride > 1 || v % kChunk > 0)) at_vertex[v] = field.at(mesh.vertices[v], hint, exact_above);
    });
    for (std::size_t i = 0; i < at_vertex.size(); ++i) learn(at_vertex[i], mesh.vertices[i], exact_above);
    if (found.lower > goal.fail) return found;
  }

  const auto unsettled = [&] { return std::max(goal.pass, found.lower + goal.tolerance); };
  // If f may be 0 at all corners.
  const auto bound_lying = [&](SubTriangle& cell, double exact_above) {
    if (cell.upper <= kWorth * unsettled()) return;
    for (const Sample& sample : cell.sample)
      if (sample.value > std::max(exact_above, goal.tolerance)) return;
    cell.upper = std::min(cell.upper, field.lying(cell.corner));
  };

  std::vector<SubTriangle> cells(mesh.faces.size()), halves;
  for_each(cells.size(), [&](std::size_t f) {
    cells[f].corner = corners_of(mesh, mesh.faces[f]);
    for (int i = 0; i < 3; ++i) cells[f].sample[i] = at_vertex[mesh.faces[f][i]];
    cells[f].upper = upper_bound(field, cells[f]);
    bound_lying(cells[f], enough());
  });

  const auto drop = [&](std::vector<SubTriangle>& open) {
    const auto settled = [&](const SubTriangle& cell) {
      if (cell.upper > unsettled()) return false;
      dropped = std::max(dropped, cell.upper);
      return true;
    };
    open.erase(std::remove_if(open.begin(), open.end(), settled), open.end());
  };
  drop(cells);
  for (std::size_t looked_at = 0; !cells.empty() && looked_at < kMostCells; looked_at += cells.size()) {
    const double exact_above = enough();
    halves.resize(2 * cells.size());
    for_each(cells.size(), [&](std::size_t c) {
      auto pair = bisect(field, cells[c], exact_above);
      for (SubTriangle& half : pair) bound_lying(half, exact_above);
      halves[2 * c] = pair[0];
      halves[2 * c + 1] = pair[1];
    });
    for (std::size_t c = 0; c < halves.size(); c += 2) learn(halves[c].sample[0], halves[c].corner[0], exact_above);
    if (found.lower > goal.fail) return found;
    cells.swap(halves);
    drop(cells);
  }
  found.upper = std::max(found.lower, dropped);
  for (const SubTriangle& cell : cells) found.upper = std::max(found.upper, cell.upper);
  return found;
}

// An upper bound of the maximum that is tight also where the goal lets it be loose, if triangles lie on what they are
// measured to: by the witness of every triangle's centre alone, or where the field is 0.
template <class Field>
double tightened(const Field& field, const Mesh& mesh, Interval found) {
  double most = found.lower;
  for (std::size_t f = 0; f < mesh.faces.size() && most < found.upper; ++f) {
    const Corners corner = corners_of(mesh, mesh.faces[f]);
    const std::int32_t witness = field.at((1.0 / 3.0) * (corner[0] + corner[1] + corner[2]), -1, 0).witness;
    double upper = 0;
    for (const Vec3& point : corner) upper = std::max(upper, field.from(witness, point));
    if (upper > std::max(most, kHair)) upper = std::min(upper, field.lying(corner));
    most = std::max(most, upper);
  }
  return std::min(found.upper, most);
}

}  // namespace rlacd
