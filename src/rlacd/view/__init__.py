"""Looking at a decomposition: pictures (extra ``view``) and reports."""

from rlacd.view.html_report import check_report_page, is_html, save_report_page
from rlacd.view.picture import check_picture, check_up, draw_picture

__all__ = ["check_picture", "check_report_page", "check_up", "draw_picture", "is_html", "save_report_page"]
