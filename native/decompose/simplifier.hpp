// A closed mesh with fewer and fewer triangles, near the original.
//
// In:  a closed, oriented manifold mesh; the number of triangles wanted.
// Out: a closed, oriented manifold mesh whose faces lie in the middle of those they replace, so that noise averages
//      out.
// How: Edges are collapsed to the point of least squared distance to the planes of all faces they replace (Garland and
//      Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997). While there are many faces, sweeps price
//      every edge once and collapse the cheap ones, each vertex at most once. Then, of a few edges drawn at random, the
//      cheapest is collapsed: nearly as good as the cheapest of all, without keeping them sorted (Wu and Kobbelt, "Fast
//      Mesh Decimation by Multiple-Choice Techniques", 2002). The numbers drawn are the same every time.
//      A collapse must not change the topology or turn a face over.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry.hpp"

namespace rlacd {

class Simplifier {
 public:
  explicit Simplifier(const Mesh& mesh);

  // Collapses edges until at most `count` faces are left, or hardly any edge can be collapsed. The result does not
  // depend on the number of threads.
  void reduce(std::size_t count, int threads = 1);
  std::size_t size() const { return alive_.size(); }
  Mesh mesh() const;

 private:
  struct Quadric {  // x' A x + 2 b x + c
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    Vec3 b{0, 0, 0};
    double c = 0;

    void add_plane(Vec3 normal, double offset, double weight);
    void add(const Quadric& other);
    double at(Vec3 x) const;
    Vec3 times(Vec3 x) const;
    Vec3 least_near(Vec3 x) const;
  };
  struct Candidate {
    std::int32_t from = -1, to = -1;
    Vec3 point;
    double cost = 0;
  };

  void sweep(std::size_t count, int threads);
  std::vector<std::int32_t> cheap_edges(int threads) const;
  void collapse_drawn(std::size_t count);
  Candidate random_edge();
  Candidate priced(std::int32_t from, std::int32_t to) const;
  bool collapse(const Candidate& edge);
  void gather(std::int32_t vertex, std::vector<std::int32_t>& faces);
  bool turns_over(const std::vector<std::int32_t>& faces, std::int32_t vertex, std::int32_t other, Vec3 point) const;
  bool keeps_topology(std::int32_t from, std::int32_t to);
  void remove(std::int32_t face);

  std::vector<Vec3> points_;
  std::vector<Quadric> quadrics_;
  std::vector<Triangle> faces_;
  std::vector<std::int32_t> alive_, place_;        // faces that are left; where in `alive_` a face is, or -1
  std::vector<std::int32_t> first_, last_, next_;  // lists of the faces around a vertex, by corner 3 f + k
  std::vector<std::int32_t> around_from_, around_to_, mark_;
  std::vector<Candidate> candidates_;
  std::int32_t stamp_ = 0;
  std::uint64_t drawn_ = 0;
};

}  // namespace rlacd
