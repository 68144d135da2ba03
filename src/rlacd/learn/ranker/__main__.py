"""``python -m rlacd.learn.ranker MESHES WORK``: train a plane ranker from scratch, or continue a run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import MISSING, fields
from pathlib import Path

from rlacd.errors import RlacdError
from rlacd.learn.ranker.train import TrainOptions, train
from rlacd.pool import open_pool


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 1 after one sentence on standard error if it fails."""
    about = "Train a guide from scratch, or go on with a run."
    parser = argparse.ArgumentParser(prog="python -m rlacd.learn.ranker", description=about)
    for option in fields(TrainOptions):
        text = option.metadata["help"]
        if option.default is MISSING:
            parser.add_argument(option.name, type=Path, help=text)
        else:
            flag = "--" + option.name.replace("_", "-")
            parser.add_argument(flag, type=type(option.default), default=option.default, help=f"{text} (%(default)s)")
    parser.add_argument("--jobs", type=int, help="processes that label; 0: this one (1)")
    parser.add_argument("--ray", metavar="ADDRESS", help="label on a Ray cluster: its address, auto, or local")
    given = vars(parser.parse_args(arguments))
    try:
        with open_pool(given.pop("jobs"), given.pop("ray")) as pool:
            print(train(TrainOptions(**given), say=lambda line: print(line, flush=True), pool=pool))
    except RlacdError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
