"""``python -m benchmarks COMMAND``; see `COMMANDS`."""

from __future__ import annotations

import sys
from importlib import import_module

COMMANDS = {
    "fetch": "brings the meshes that the numbers are of, from public repositories, with git",
    "compare": "rlacd beside CoACD, V-HACD and itself with other options; quality levels, whole corpora",
    "late": "how late a decomposition ends after a timeout or Ctrl-C",
    "batch": "the overhead of a batch beside its meshes",
    "physics": "ten tasks in MuJoCo and PyBullet: a mug on a hook, gears that mesh, a stack; a film of two",
    "piles": "any meshes' hulls in MuJoCo: piles, balls dropped into holes; primitives",
    "robots": "whole robots: hulls a link, farthest, MuJoCo's speed, each mesh at its own scale and links as solids",
    "planted": "solids made of k convex bodies: furniture, stairs, combs, crossing boxes, bars, rods and blobs",
    "paper": "the paper's training to the letter, on the features of I2P-MAE",
    "curves": "the curves of trainings, drawn",
}
"""Name to purpose; each is a module of that name with a click command ``app``."""

HELP = f"""Usage: python -m benchmarks COMMAND --help

Every published number comes from one of these commands. Meshes and methods run in processes of their own, with
limits. Results are kept in a folder and never computed twice: a run that was stopped goes on. CPU seconds are those of
one thread and barely depend on what else the machine does. `--group bench` of pip installs the tools compared.

Start with:  python -m benchmarks compare MESHES --list MESHES/quick.txt --out RUN

Commands:
{chr(10).join(f"  {name:10} {what}" for name, what in COMMANDS.items())}
"""


def main(arguments: list[str]) -> None:
    """Run the command that the arguments start with."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(HELP)
        return
    name, *others = arguments
    if name not in COMMANDS:
        raise SystemExit(f"there is no command {name!r}; it has to be {', '.join(COMMANDS)}.")
    module = import_module(f"benchmarks.{name.replace('-', '_')}")
    module.app(others, prog_name=f"python -m benchmarks {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
