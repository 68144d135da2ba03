"""Existing robot descriptions: every collision mesh is replaced by its hulls, and the rest kept byte for byte."""

from rlacd.io.robots.read import is_robot
from rlacd.io.robots.rewrite import rewrite_robot
from rlacd.io.robots.rewritten import RewrittenLink, RewrittenRobot

__all__ = ["RewrittenLink", "RewrittenRobot", "is_robot", "rewrite_robot"]
