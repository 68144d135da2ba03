"""Looking at a decomposition: pictures (extra ``view``)."""

from rlacd.show.picture import check_picture, draw_picture

__all__ = ["check_picture", "draw_picture"]
