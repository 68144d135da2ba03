// The Python module: one bind function per file of bindings.
#include <nanobind/nanobind.h>

namespace rlacd {
void bind_cut(nanobind::module_& m);
void bind_distance(nanobind::module_& m);
void bind_hull(nanobind::module_& m);
void bind_mesh(nanobind::module_& m);
void bind_navigable(nanobind::module_& m);
void bind_numbers(nanobind::module_& m);
void bind_stop(nanobind::module_& m);
}  // namespace rlacd

NB_MODULE(_native, m) {
  m.doc() =
      "C++ kernels of rlacd. Arrays are float64 points [N, 3] and int32 faces [F, 3]; the GIL is released inside.";
#ifdef NDEBUG
  // A thread still at work when Python exits holds objects: that is not a leak, and nothing to warn a user about.
  nanobind::set_leak_warnings(false);
#endif
  for (const auto bind : {rlacd::bind_cut, rlacd::bind_distance, rlacd::bind_hull, rlacd::bind_mesh,
                          rlacd::bind_navigable, rlacd::bind_numbers, rlacd::bind_stop})
    bind(m);
}
