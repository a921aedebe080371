"""Profiles, materials and scenes as frozen models read from YAML."""
