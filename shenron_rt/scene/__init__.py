"""Meshes and their tags, ready-made shapes, actors and motion."""
