"""Hulls for a model that a program builds: ``add_hulls`` for MuJoCo's MjSpec, Newton's ModelBuilder, Drake's plant.

Each module is named after its engine, which it imports only when called, and takes the same arguments.
"""
