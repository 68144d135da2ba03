// Python bindings of candidate planes, of the plane sweep, of plane cuts, and of reuniting the pieces they leave.
#include "bind/released.hpp"
#include "core/mesh_measures.hpp"
#include "decompose/concave_edges.hpp"
#include "decompose/least_excess.hpp"
#include "decompose/sweep.hpp"
#include "solid/pieces.hpp"
#include "solid/reunite.hpp"

namespace rlacd {

double scalar(Tag<PlaneScore>);
auto parts(Piece& own) {
  return std::tie(own.mesh.vertices, own.mesh.faces, own.volume, own.hull.vertices, own.hull.faces, own.hull_volume);
}

namespace {

using OffsetsIn = ArrayIn<double, nb::ndim<2>>;

std::vector<double> to_offsets(const OffsetsIn& array, const std::vector<Vec3>& directions) {
  require(array.shape(0) == directions.size(), "one row of offsets a direction");
  return copied<double>(array);
}

}  // namespace

void bind_cut(nb::module_& m) {
  m.def("candidate_planes", released([](const Mesh& mesh, const ConvexBody& hull, int per_axis, std::size_t edges) {
          std::vector<Plane> planes;
          if (per_axis > 0) planes = equidistant_planes(mesh, hull, per_axis);
          for (const Plane& plane : concave_planes(mesh, hull, edges)) planes.push_back(plane);
          return planes;
        }),
        "vertices"_a, "faces"_a, "hull"_a, "per_axis"_a, "edges"_a,
        "Unit normals and offsets [K, 4] of planes: `per_axis` along each coordinate axis and principal axis, which "
        "divide the hull's extent into equal slabs, and at most three for each of the concave edges chosen.");
  m.def(
      "sweep",
      released([](const Mesh& mesh, const std::vector<Vec3>& directions, const OffsetsIn& offsets, int threads) {
        return sweep(mesh, directions, to_offsets(offsets, directions), threads);
      }),
      "vertices"_a, "faces"_a, "directions"_a, "offsets"_a, "threads"_a = 0,
      "Scores of the planes n.x = d for unit directions n [K, 3] and ascending offsets d [K, M]: float64 [K * M, "
      "10].\n\n"
      "Columns: hull volume below, above; solid volume below, above; section area, perimeter; thickness below, above; "
      "largest extent below, above. The mesh must be closed and outward oriented.");
  m.def("find_least_excess",
        released([](const Mesh& mesh, const std::vector<Vec3>& directions, const OffsetsIn& offsets, double exponent,
                    double tie, double least_solid, const std::vector<double>& slivers, int threads) {
          return find_least_excess(mesh, directions, to_offsets(offsets, directions),
                                   {exponent, tie, least_solid, slivers}, threads);
        }),
        "vertices"_a, "faces"_a, "directions"_a, "offsets"_a, "exponent"_a, "tie"_a, "least_solid"_a, "slivers"_a,
        "threads"_a = 0,
        "The first of the planes n.x = d, for unit directions n [K, 3] and ascending offsets d [K, M], whose sides' "
        "excesses (volume of the hull less that of the solid) have the least norm; -1 where no plane is valid.\n\n"
        "A plane is valid where both sides hold more than `least_solid` and are thicker than a share of their largest "
        "extent: the first of `slivers` by which there are valid planes. Costs, the norm's power `exponent` where that "
        "is finite, that differ by no more than `tie` are equal. The mesh must be closed and outward oriented.");
  m.def("cut", released([](const Mesh& mesh, double x, double y, double z, double offset, double least) {
          return cut(mesh, {x, y, z}, offset, least);
        }),
        "vertices"_a, "faces"_a, "x"_a, "y"_a, "z"_a, "offset"_a, "least"_a,
        "The closed sides below and above a plane of a closed mesh: for each its vertices [V, 3], faces [F, 3] and "
        "volume, and those of its hull; None for a side of no more than the least volume, or without a hull.");
  m.def("halve_between",
        released([](const Mesh& mesh, const ConvexBody& hull, const std::vector<const ConvexBody*>& around,
                    double share, double least) { return halve(mesh, hull, between(hull, around), share, least); }),
        "vertices"_a, "faces"_a, "hull"_a, "around"_a, "share"_a, "least"_a,
        "The sides of a closed mesh, as `cut` returns them, of a plane at a share of its length, from the one to the "
        "other of the two hulls around whose volumes it would add the least to: the smaller first, none if one would "
        "be empty or there are no two.");
  m.def("halve_along",
        released([](const Mesh& mesh, const ConvexBody& hull, bool principal, double share, double least) {
          const auto axes = principal ? principal_axes(mesh) : std::array<Vec3, 3>{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
          return halve(mesh, hull, {axes.begin(), axes.end()}, share, least);
        }),
        "vertices"_a, "faces"_a, "hull"_a, "principal"_a, "share"_a, "least"_a,
        "The same along the longest coordinate axis or principal axis.");
  m.def(
      "connected_pieces", released(connected_pieces), "vertices"_a, "faces"_a, "least"_a,
      "The pieces of a closed mesh that edges connect, with their cavities, as `cut` returns its sides, without those "
      "of no more than the least volume; None if all is one piece.");
  m.def("reunite", released([](const std::vector<Mesh>& solids, double least) {
          std::optional<Mesh> united = reunited(solids);
          return united ? piece_of(std::move(*united), least) : std::nullopt;
        }),
        "vertices"_a, "faces"_a, "least"_a,
        "Solids with disjoint interiors that touch face to face as one, as `cut` returns its sides; None if rounding "
        "leaves it open.");
}

}  // namespace rlacd
