// Python bindings of Stop.
#include <nanobind/nanobind.h>

#include <limits>

#include "core/interrupts.hpp"
#include "core/stop.hpp"

namespace rlacd {

namespace nb = nanobind;

void bind_stop(nb::module_& m) {
  nb::exception<Stopped>(m, "Stopped", PyExc_BaseException).doc() =
      "Raised by kernels, and by `poll_stop`, once the work has to stop. No error: nothing that handles errors sees "
      "it.";
  nb::class_<Stop>(m, "Stop", "What stops the work in the threads that use it.")
      .def(nb::init<>())
      .def(
          "begin",
          [](Stop& self, nb::callable look) {
            self.begin([look = std::move(look)] {
              const nb::gil_scoped_acquire acquire;
              if (PyErr_CheckSignals() != 0) throw nb::python_error();
              look();
            });
          },
          nb::arg("look"), nb::sig("def begin(self, look: collections.abc.Callable[[], object]) -> None"),
          "Watch the deadline; `look` is called some ten times a second by polls in this thread, until `end`.")
      .def(
          "end", [](Stop& self) { self.end(); }, "Watch no longer, and forget `look`.")
      .def(
          "arm", [](Stop& self, double seconds) { self.arm(seconds); }, nb::arg("seconds"),
          "Trip after this many seconds, never if infinite. A token that has tripped is reset.")
      .def("trip", &Stop::trip, "Make every poll raise from now on.")
      .def("trip_after", &Stop::trip_after, nb::arg("polls"), "Trip at this poll from now on.")
      .def("shield", &Stop::shield, nb::arg("on"), "Whether polls let everything pass for now.")
      .def_prop_ro("is_tripped", &Stop::is_tripped);
  m.def(
      "use_stop",
      [](Stop* stop) {
        Stop* before = this_stop;
        this_stop = stop;
        return before;
      },
      nb::arg("stop").none(), nb::rv_policy::reference,
      "Let this thread's kernels and polls be stopped by `stop`, which has to outlive that; returns what did so far.");
  m.def(
      "seconds_left",
      [] { return this_stop != nullptr ? this_stop->seconds_left() : std::numeric_limits<double>::infinity(); },
      "Until this thread's work has to stop; infinity where it never has to.");
  m.def("count_interrupts", &count_interrupts, nb::arg("code"), nb::arg("grace"),
        nb::call_guard<nb::gil_scoped_release>(),
        "Exit with `code` some seconds after the second Ctrl-C from now on, whatever holds the GIL.");
  m.def("forget_interrupts", &forget_interrupts, nb::call_guard<nb::gil_scoped_release>(),
        "Let Ctrl-C be as it was before `count_interrupts`.");
  m.def("poll_stop", [] { poll_stop(); }, "Raise `Stopped` if this thread's work has to stop.");
}

}  // namespace rlacd
