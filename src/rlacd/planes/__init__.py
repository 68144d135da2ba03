"""Candidate cut planes and the sweep that scores them."""
