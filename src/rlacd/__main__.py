"""``python -m rlacd``: the command line."""

from rlacd.cli.main import main

if __name__ == "__main__":
    main()
