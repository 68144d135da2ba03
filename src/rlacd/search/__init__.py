"""Search for fewer parts than one pass of cuts finds."""
