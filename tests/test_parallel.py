"""Work on threads: every row once, in order, and results that do not depend on how many threads there are."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from shenron_rt._parallel import BLOCK, map_blocks


def test_blocks_cover_all_rows_in_order() -> None:
    n = 3 * BLOCK + 5
    slices = map_blocks(lambda rows: rows, n)
    np.testing.assert_array_equal(np.concatenate([np.arange(n)[s] for s in slices]), np.arange(n))
    assert map_blocks(lambda rows: rows, 0) == []


def test_a_sweep_of_many_cells_is_the_same_bytes_on_any_number_of_threads() -> None:
    """270,000 cells are many blocks: they must add up alike whether one thread makes them or two."""
    code = (
        "import sys, numpy, shenron_rt as srt\n"
        "from shenron_rt._parallel import limit_threads\n"
        "limit_threads(int(sys.argv[1]))\n"
        "sweep = srt.sweep_rcs('dihedral:a=1,b=1,h=1', frequency_hz=77e9, azimuth_deg=[3.0, 11.0], max_bounces=2)\n"
        "print(sweep.amplitude.tobytes().hex())"
    )
    bytes_of = [
        subprocess.run([sys.executable, "-c", code, n], capture_output=True, text=True, check=True).stdout
        for n in ("1", "2")
    ]
    assert bytes_of[0] == bytes_of[1]
    assert len(bytes_of[0]) > 32
