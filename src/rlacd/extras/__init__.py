"""What only some options ask for, a package for each room that has such: no default run imports it."""
