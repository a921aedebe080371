"""What the RCS solver is held to: one bar per file's idea, measured through the public ``sweep_rcs``.

``examples/rcs_validation.py`` writes them as a docs page, ``tests/test_rcs_*.py`` hold them.
"""
