"""Pictures of a decomposition."""
