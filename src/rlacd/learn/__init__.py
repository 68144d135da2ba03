"""Learning which plane to cut by (extra `train`); nothing outside imports this room but the command `rlacd train`."""
