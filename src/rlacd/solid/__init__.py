"""From a file to a closed solid and its components: load, repair, cut, hull, volume."""
