"""Existing robot descriptions: every collision mesh is replaced by its hulls, and the rest kept byte for byte."""

from rlacd.io.robots.rewrite import Rewritten, RewrittenMesh, is_robot, rewrite_robot

__all__ = ["Rewritten", "RewrittenMesh", "is_robot", "rewrite_robot"]
