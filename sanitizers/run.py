"""Run Python with the kernels of a sanitized build, and fail when a sanitizer reports anything.

    python sanitizers/run.py address native             the tests in C++
    python sanitizers/run.py address tests              tests in Python that reach the kernels
    python sanitizers/run.py thread meshes              real meshes, decomposed in every way
    python sanitizers/run.py address -m fuzz.kernels --count 300

`make sanitize-address` and `make sanitize-thread` make the builds and do the first three. Python itself and the
libraries are not instrumented: the runtime is preloaded, and watches what the kernels do. Reports of all processes,
children too, are written to files in the build's folder and shown at the end.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ADDR_NO_RANDOMIZE = 0x0040000

NATIVE_TESTS = (
    *("hull", "sweep", "distance", "concavity", "concave_edges", "limits", "metrics"),
    *("plane_cut", "overlap", "decomposition", "fuzz_found", "kernels_refuse"),
    *("proxy", "stop"),
    *("navigable", "merge", "decompose", "search", "policies", "bad_input"),
)
"""Files of tests/ that reach the kernels."""

CANNOT = {
    # It hands a signal over at the next call of the C library, and what is interrupted here makes none.
    "thread": ("tests/run/test_stop.py::test_ctrl_c_twice_ends_a_command_that_no_handler_of_python_can_interrupt",)
}
"""Tests that a sanitizer's runtime makes impossible."""

RUNTIMES = {"address": ("libasan.so", "libubsan.so"), "thread": ("libtsan.so",)}

CONTROL = {"address": ("read_after_the_end", "-fsanitize=address"), "thread": ("race", "-fsanitize=thread")}

OPTIONS = {
    # Python frees little at its end, which is no leak of ours; numpy asks for more memory than there is and copes.
    "ASAN_OPTIONS": "detect_leaks=0:detect_stack_use_after_return=1:allocator_may_return_null=1:halt_on_error=1",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
    # What libraries without instrumentation do to memory is invisible but for their calls of malloc and memcpy, which
    # would look like races because the locks and atomics around them are not seen either.
    "TSAN_OPTIONS": "allocator_may_return_null=1:ignore_noninstrumented_modules=1:halt_on_error=0:"
    "second_deadlock_stack=1:exitcode=66",
}


def environment(kind: str, reports: Path) -> dict[str, str]:
    """What has to be in the environment so that Python can load the build."""
    libraries = [*RUNTIMES[kind], "libstdc++.so.6"]  # exceptions are watched from where they are thrown
    found = [
        subprocess.run(["gcc", f"-print-file-name={name}"], check=True, capture_output=True, text=True).stdout.strip()
        for name in libraries
    ]
    options = {
        name: f"{words}:log_path={reports / 'report'}:{os.environ.get(name, '')}" for name, words in OPTIONS.items()
    }
    suppressions = HERE / f"{kind}.supp"
    if suppressions.exists():
        options[f"{kind[0].upper()}SAN_OPTIONS"] += f":suppressions={suppressions}"
    return {**os.environ, **options, "LD_PRELOAD": " ".join(found), "PYTHONUNBUFFERED": "1", "OMP_NUM_THREADS": "1"}


def command(kind: str, build: Path, words: list[str]) -> list[str]:
    python = str(build / "bin" / "python")
    if words == ["native"]:
        return [str(build / "native" / "rlacd_tests")]
    if words == ["tests"]:
        named = [str(path) for name in NATIVE_TESTS for path in Path("tests").rglob(f"test_{name}.py")]
        skipped = [f"--deselect={name}" for name in CANNOT.get(kind, ())]
        return [python, "-m", "pytest", "-p", "no:cacheprovider", "tests/repair", *named, *skipped]
    if words[:1] == ["meshes"]:
        return [python, str(HERE / "meshes.py"), *words[1:]]
    return [python, *words]


def without_random_addresses() -> None:
    """The thread sanitizer wants certain ranges of addresses free, which 32 random bits do not leave."""
    ctypes.CDLL(None).personality(ADDR_NO_RANDOMIZE)


def run(kind: str, build: Path, words: list[str], quiet: bool = False) -> tuple[int, list[str]]:
    """The exit status, and the reports of all processes that were started."""
    with tempfile.TemporaryDirectory(dir=build) as folder:
        done = subprocess.run(
            words,
            cwd=HERE.parent,
            env=environment(kind, Path(folder)),
            preexec_fn=without_random_addresses,
            stderr=subprocess.DEVNULL if quiet else None,
        )
        return done.returncode, [path.read_text(errors="replace") for path in sorted(Path(folder).glob("report*"))]


def check_that_it_watches(kind: str, build: Path) -> None:
    """Make a mistake on purpose, in the same surroundings: it has to be seen."""
    library, mistake, flags = build / "control.so", *CONTROL[kind]
    compiler = [
        "g++",
        "-O1",
        "-g",
        "-fPIC",
        "-shared",
        "-pthread",
        flags,
        str(HERE / "control.cpp"),
        "-o",
        str(library),
    ]
    subprocess.run(compiler, check=True)
    code = f"import ctypes; ctypes.CDLL({str(library)!r}).{mistake}()"
    status, reports = run(kind, build, [str(build / "bin" / "python"), "-c", code], quiet=True)
    if status == 0 and not reports:
        sys.exit(f"the {kind} sanitizer does not see a mistake made on purpose ({mistake} in sanitizers/control.cpp)")


def main() -> None:
    kind, *words = sys.argv[1:]
    build = HERE.parent / "build" / f"sanitize-{kind}"
    check_that_it_watches(kind, build)
    status, reports = run(kind, build, command(kind, build, words))
    for report in reports:
        print(f"---\n{report[:4000]}")
    print(f"{kind} sanitizer: {len(reports)} processes with reports, exit status {status}")
    sys.exit(1 if reports else status)


if __name__ == "__main__":
    main()
