// Python bindings of grids of cells.
#include "base/arrays.hpp"
#include "mesh/cells.hpp"

namespace rlacd {

namespace {

template <class Scalar>
using GridIn = nb::ndarray<const Scalar, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using CellsIn = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class Grid>
Cell shape_of(const Grid& grid) {
  return {static_cast<std::int64_t>(grid.shape(0)), static_cast<std::int64_t>(grid.shape(1)),
          static_cast<std::int64_t>(grid.shape(2))};
}

}  // namespace

void bind_cells(nb::module_& m) {
  m.def(
      "label_cells",
      [](const GridIn<bool>& marks) { return rows<std::int64_t>(label_cells(marks.data(), shape_of(marks))); },
      Released(), nb::arg("marks"),
      "Labels [X * Y * Z] of the connected sets of marked cells [X, Y, Z], which share sides, from 1 on by their "
      "first\n"
      "cells; 0 for all other cells.");
  m.def(
      "nearest_labels",
      [](const GridIn<std::int64_t>& labels, const CellsIn& array, double reach) {
        const Cell shape = shape_of(labels);
        std::vector<Cell> cells(array.shape(0));
        for (std::size_t n = 0; n < cells.size(); ++n)
          for (std::size_t axis = 0; axis < 3; ++axis) {
            cells[n][axis] = array(n, axis);
            if (cells[n][axis] < 0 || cells[n][axis] >= shape[axis]) throw std::invalid_argument("a cell off the grid");
          }
        if (!(reach >= 0 && reach < 1000)) throw std::invalid_argument("the reach has to be from 0 to 1000 cells");
        return rows<std::int64_t>(nearest_labels(labels.data(), shape, cells, reach));
      },
      Released(), nb::arg("labels"), nb::arg("cells"), nb::arg("reach"),
      "The label [N] of the nearest labelled cell of a grid [X, Y, Z] at most `reach` cells away from each cell [N, "
      "3];\n"
      "0 where there is none.");
}

}  // namespace rlacd
