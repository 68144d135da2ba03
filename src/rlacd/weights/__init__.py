"""The shipped weights; see README.md beside them."""
