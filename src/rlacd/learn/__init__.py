"""Learning which plane to cut by (extra `train`); outside this package only the commands of `rlacd train` import it."""
