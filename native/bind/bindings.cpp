// The Python module: one bind function per kernel, each defined in the kernel's own bind file.
#include <nanobind/nanobind.h>

namespace rlacd {
void bind_cells(nanobind::module_& m);
void bind_concavity(nanobind::module_& m);
void bind_distance(nanobind::module_& m);
void bind_flush(nanobind::module_& m);
void bind_glue(nanobind::module_& m);
void bind_hull(nanobind::module_& m);
void bind_mesh(nanobind::module_& m);
void bind_navigable(nanobind::module_& m);
void bind_plane_cut(nanobind::module_& m);
void bind_simplifier(nanobind::module_& m);
void bind_simplify(nanobind::module_& m);
void bind_stop(nanobind::module_& m);
void bind_sweep(nanobind::module_& m);
void bind_union(nanobind::module_& m);
}  // namespace rlacd

NB_MODULE(_native, m) {
  m.doc() =
      "C++ kernels of rlacd. Arrays are float64 points [N, 3] and int32 faces [F, 3]; the GIL is released inside.";
#ifdef NDEBUG
  // A thread still at work when Python exits holds objects: that is not a leak, and nothing to warn a user about.
  nanobind::set_leak_warnings(false);
#endif
  rlacd::bind_cells(m);
  rlacd::bind_concavity(m);
  rlacd::bind_distance(m);
  rlacd::bind_flush(m);
  rlacd::bind_glue(m);
  rlacd::bind_hull(m);
  rlacd::bind_mesh(m);
  rlacd::bind_navigable(m);
  rlacd::bind_plane_cut(m);
  rlacd::bind_simplifier(m);
  rlacd::bind_simplify(m);
  rlacd::bind_stop(m);
  rlacd::bind_sweep(m);
  rlacd::bind_union(m);
}
