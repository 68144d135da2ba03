"""The `rlacd` command: one module per subcommand, and what they print."""
