"""Streams of random numbers: one for each frame, radar and stage, the same every time."""

from __future__ import annotations

import itertools
import zlib

import numpy as np
import pytest

from shenron_rt.randomness import frame_generator


def draw(*key):
    return tuple(frame_generator(*key).standard_normal(4))


def test_same_key_gives_the_same_numbers():
    assert draw(3, 5, "front", "noise") == draw(3, 5, "front", "noise")


def test_every_part_of_the_key_counts():
    keys = itertools.product((0, 1), (0, 1), ("", "front", "rear"), ("rays", "speckle", "noise"))
    assert len({draw(*key) for key in keys}) == 36


def test_streams_are_uncorrelated():
    """50 streams of 2000 numbers: correlations of RMS 1/sqrt(2000) = 0.022."""
    streams = np.array([frame_generator(1, f, "front", "rays").standard_normal(2_000) for f in range(50)])
    off_diagonal = np.corrcoef(streams)[np.triu_indices(50, 1)]
    assert np.sqrt(np.mean(off_diagonal**2)) == pytest.approx(0.0224, rel=0.1)
    assert np.max(np.abs(off_diagonal)) < 0.12


def test_seeding_is_the_documented_one():
    """The documented seeding: SeedSequence(seed, spawn_key=(frame, crc32(radar), crc32(stage)))."""
    words = (2, zlib.crc32(b"front"), zlib.crc32(b"rays"))
    expected = np.random.default_rng(np.random.SeedSequence(7, spawn_key=words))
    assert draw(7, 2, "front", "rays") == tuple(expected.standard_normal(4))


def test_a_negative_seed_is_refused():
    with pytest.raises(ValueError, match="non-negative"):
        frame_generator(-1, 0, "", "rays")
