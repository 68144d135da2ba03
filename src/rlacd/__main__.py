"""``python -m rlacd`` and the ``rlacd`` script: the command line."""

import os
import sys


def main() -> None:
    """Run the command line; Ctrl-C is no traceback, not even while it is imported."""
    try:
        from rlacd.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("rlacd: interrupted; no file is left half-written.\n")
        sys.stderr.flush()
        os._exit(130)


if __name__ == "__main__":
    main()
