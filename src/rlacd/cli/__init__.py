"""The `rlacd` command: a module a subcommand, and what they print."""
