"""The plane ranker: a small network that ranks planes by the final number of parts, learned from rollouts."""
