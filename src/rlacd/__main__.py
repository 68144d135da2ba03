"""``python -m rlacd`` and the ``rlacd`` script: the command line."""

import os
import signal
import sys


def main() -> None:
    """Run the command line; Ctrl-C and SIGTERM are no traceback, not even while it is imported."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from rlacd.cli.main import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("rlacd: interrupted; no file is left half-written.\n")
        sys.stderr.flush()
        os._exit(130)


if __name__ == "__main__":
    main()
