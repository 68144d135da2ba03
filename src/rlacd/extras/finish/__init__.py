"""Hulls that only options ask for: primitives, and hulls that overlap."""
