"""Looking at a decomposition: pictures (extra ``view``), reports, and a viewer in the browser."""
