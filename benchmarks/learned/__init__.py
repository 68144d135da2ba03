"""`policy="learned"`: labels, networks, and the comparison of policies."""
