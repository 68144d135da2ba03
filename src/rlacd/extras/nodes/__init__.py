"""The nodes of a scene, each decomposed for itself: their twins, their joint report."""
