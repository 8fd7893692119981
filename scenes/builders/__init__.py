"""Builders: parts of a scene that are made, not read."""
