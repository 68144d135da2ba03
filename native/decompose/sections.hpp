// Parallel planes through a mesh: their sections, the slabs between them, and the volumes of the solid on both sides.
//
// Input:  a closed triangle mesh, a unit normal n and M ascending offsets d (planes n.x = d). They divide the mesh into
//         M + 1 slabs; slab j lies below plane j and above plane j - 1.
// Output: the vertices of each slab, the corners of the convex hull of each plane's
//         section, and the volume of the solid below and above each plane.
// Algorithm: vertices are sorted into slabs, and every edge is cut by the planes between its ends. Volumes come from
//         the divergence theorem with the field (n.x - d) n, which vanishes on the cut, so that no cap is needed.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry.hpp"
#include "surface/edges.hpp"

namespace rlacd {

// Data of a mesh that the sections of all directions share. Keeps a reference to the mesh.
struct SolidMesh {
  explicit SolidMesh(const Mesh& solid);

  const Mesh& mesh;
  std::vector<Vec3> area;       // of every face, times its normal
  std::vector<char> is_corner;  // of a face, for every vertex
  double volume;
};

class Sections {
 public:
  // Keeps a reference to the solid.
  Sections(const SolidMesh& solid, Vec3 normal, std::vector<double> offsets);

  std::size_t planes() const { return offsets_.size(); }
  Vec3 normal() const { return normal_; }
  double offset(std::size_t plane) const { return offsets_[plane]; }
  double lowest() const { return lowest_; }  // least n.x of the vertices: infinity if there are none
  double highest() const { return highest_; }
  // Points that protrude from a hull by less than this are rounding: the crossings of one long edge with many planes
  // are collinear only up to the last bits.
  double film() const { return film_; }

  // Calls task(point) for the vertices of slabs [from, to). A vertex on a plane belongs to a side
  // if the surface continues there: a face that lies in the plane bounds the solid on one side of it only.
  template <class Task>
  void for_each_inside(std::size_t from, std::size_t to, const Task& task) const {
    slabs_.for_each(from, to, [&](std::int32_t vertex) { task(mesh_.vertices[vertex]); });
  }
  // Corners of the section's convex hull, in the order of its outline.
  const std::vector<Vec3>& outline(std::size_t plane) const { return outlines_[plane]; }
  // Area of the convex hull of the vertices at the lowest or the highest end.
  double end_area(bool lowest) const;

  double solid_below(std::size_t plane) const { return solid_below_[plane]; }
  double solid_above(std::size_t plane) const { return solid_.volume - solid_below_[plane]; }

  // Area and perimeter of each plane's section of the solid itself.
  struct Measures {
    double area = 0, perimeter = 0;
  };
  std::vector<Measures> measure_sections() const;

 private:
  void project();
  void fill_slabs();
  void cut_edges();
  void measure_solid();
  bool is_between_planes(const Triangle& face) const;
  std::int32_t lowest_corner(const Triangle& face) const;
  std::size_t first_from(std::int32_t vertex) const;  // first plane not below it
  Vec3 crossing(std::int32_t low, std::int32_t high, double offset) const;

  const SolidMesh& solid_;
  const Mesh& mesh_;
  const Vec3 normal_;
  const int axis_;  // the coordinate axis that the normal equals, or -1
  const std::vector<double> offsets_;
  std::vector<double> heights_;      // n.x of every vertex
  std::vector<std::int32_t> above_;  // first plane with offset > n.x, of every vertex
  double lowest_ = kInfinity;
  double highest_ = -kInfinity;
  double film_ = 0;
  bool is_on_plane_ = false;     // whether any vertex lies on a plane
  Buckets<std::int32_t> slabs_;  // their vertices
  std::vector<std::vector<Vec3>> outlines_;
  std::vector<double> solid_below_;
};

// Area of a convex polygon seen along n, its corners in order.
double outline_area(const std::vector<Vec3>& outline, Vec3 n);

// Planes n.x = d grouped by normal: planes with equal normals share a bundle, in which every offset occurs once.
struct Bundle {
  Vec3 normal;
  std::vector<double> offsets;  // ascending
};

struct Bundles {
  std::vector<Bundle> all;
  struct Place {
    std::size_t bundle, plane;
  };
  std::vector<Place> place;  // of every plane given
};

// Bundles of K directions times M offsets (row-major).
Bundles bundle_planes(const std::vector<Vec3>& directions, const std::vector<double>& offsets);

}  // namespace rlacd
