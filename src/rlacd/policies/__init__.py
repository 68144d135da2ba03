"""Which plane to cut next."""
