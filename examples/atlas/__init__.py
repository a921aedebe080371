"""What docs/rcs-atlas.md is made of: cases, published levels, results kept on the way, statistics, tables, pictures.

``examples/rcs_atlas.py`` writes the page, ``tests/test_rcs_atlas.py`` holds its numbers to the code.
"""
