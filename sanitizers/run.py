"""Run Python with the kernels of a sanitized build, and fail when a sanitizer reports anything.

    python sanitizers/run.py address tests              the native tests
    python sanitizers/run.py thread meshes              real meshes, decomposed in every way
    python sanitizers/run.py address -m fuzz.shapes --count 300

`make sanitize-address` and `make sanitize-thread` make the builds and do the first two. Python itself and the libraries
are not instrumented: the runtime is preloaded, and watches what the kernels do. Reports of all processes, children too,
are written to files in the build's folder and shown at the end.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ADDR_NO_RANDOMIZE = 0x0040000

NATIVE_TESTS = (
    *("hull", "sweep", "glue", "surface", "distance", "concavity", "concave_edges", "limits", "component", "metrics"),
    *("navigable", "navigable_decompose", "merge", "repair", "decompose", "search", "learned", "fuzz", "bad_input"),
)
"""Files of tests/ that reach the kernels."""

RUNTIMES = {"address": ("libasan.so", "libubsan.so"), "thread": ("libtsan.so",)}

OPTIONS = {
    # Python frees little at its end, which is no leak of ours; numpy asks for more memory than there is and copes.
    "ASAN_OPTIONS": "detect_leaks=0:detect_stack_use_after_return=1:allocator_may_return_null=1:halt_on_error=1",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
    # What libraries without instrumentation do to memory is invisible but for their calls of malloc and memcpy, which
    # would look like races because the locks and atomics around them are not seen either.
    "TSAN_OPTIONS": "ignore_noninstrumented_modules=1:halt_on_error=0:second_deadlock_stack=1:exitcode=66",
}


def environment(kind: str, reports: Path) -> dict[str, str]:
    """What has to be in the environment so that Python can load the build."""
    libraries = [*RUNTIMES[kind], "libstdc++.so.6"]  # exceptions are watched from where they are thrown
    found = [
        subprocess.run(["gcc", f"-print-file-name={name}"], check=True, capture_output=True, text=True).stdout.strip()
        for name in libraries
    ]
    options = {name: f"{words}:log_path={reports / 'report'}" for name, words in OPTIONS.items()}
    suppressions = HERE / f"{kind}.supp"
    if suppressions.exists():
        options[f"{kind[0].upper()}SAN_OPTIONS"] += f":suppressions={suppressions}"
    return {**os.environ, **options, "LD_PRELOAD": " ".join(found), "PYTHONMALLOC": "malloc", "OMP_NUM_THREADS": "1"}


def command(build: Path, words: list[str]) -> list[str]:
    python = str(build / "bin" / "python")
    if words == ["tests"]:
        tests = [f"tests/test_{name}.py" for name in NATIVE_TESTS]
        return [python, "-m", "pytest", "-p", "no:cacheprovider", *tests]
    if words[:1] == ["meshes"]:
        return [python, str(HERE / "meshes.py"), *words[1:]]
    return [python, *words]


def without_random_addresses() -> None:
    """The thread sanitizer wants certain ranges of addresses free, which 32 random bits do not leave."""
    ctypes.CDLL(None).personality(ADDR_NO_RANDOMIZE)


def main() -> None:
    kind, *words = sys.argv[1:]
    build = HERE.parent / "build" / f"sanitize-{kind}"
    reports = build / "reports"
    reports.mkdir(parents=True, exist_ok=True)
    for old in reports.glob("report*"):
        old.unlink()
    done = subprocess.run(
        command(build, words), cwd=HERE.parent, env=environment(kind, reports), preexec_fn=without_random_addresses
    )
    found = sorted(reports.glob("report*"))
    for report in found:
        print(f"--- {report.name}\n{report.read_text(errors='replace')[:4000]}")
    print(f"{kind} sanitizer: {len(found)} processes with reports, exit status {done.returncode}")
    sys.exit(1 if found else done.returncode)


if __name__ == "__main__":
    main()
