"""The guide: a small network that ranks the planes of a sweep by the parts they will end in, learned from rollouts."""
