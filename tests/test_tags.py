"""Tag numberings and their translation."""

from __future__ import annotations

import numpy as np
import pytest

from shenron_rt.errors import ConfigError, InputError, NotFoundError
from shenron_rt.tags import SemanticTag, TagTable, parse_tag, tag_table

# CARLA ObjectLabel.h of 0.9.13 and of 0.9.14 to 0.9.16, written out independently of the tables under test.
OLD = {1: "Buildings", 4: "Pedestrians", 7: "Roads", 10: "Car", 12: "TrafficSigns", 17: "GuardRail", 22: "Terrain"}
NEW = {
    1: "Roads",
    3: "Buildings",
    7: "TrafficLight",
    10: "Terrain",
    14: "Car",
    16: "Bus",
    24: "RoadLines",
    28: "GuardRail",
}


@pytest.mark.parametrize(("table", "known"), [("0.9.13", OLD), ("0.9.14", NEW)])
def test_numbers_mean_what_carla_says(table: str, known: dict[int, str]) -> None:
    for number, name in known.items():
        assert tag_table(table).tag(number) is SemanticTag[name]


def test_old_and_new_numbering_agree_only_at_0_and_9() -> None:
    old, new = tag_table("0.9.13"), tag_table("0.9.14")
    same = [n for n in range(23) if old.tag(n) is new.tag(n)]
    assert same == [0, 9]


def test_wrong_table_turns_roads_into_traffic_lights_and_cars_into_terrain() -> None:
    assert tag_table("0.9.14").tag(7) is SemanticTag.TrafficLight
    assert tag_table("0.9.14").tag(10) is SemanticTag.Terrain


def test_releases_between_renumberings_share_a_table() -> None:
    assert tag_table("0.9.16") is tag_table("0.9.15") is tag_table("0.9.14")
    assert tag_table("0.9.10") is tag_table("0.9.13")


def test_unknown_number_is_refused_with_its_count_and_never_becomes_other() -> None:
    with pytest.raises(InputError, match=r"'0\.9\.13' does not list 23 \(2 times\), 40 \(1 times\); it knows 0-22"):
        tag_table("0.9.13").translate(np.array([7, 23, 40, 23], dtype=np.uint32))


@pytest.mark.parametrize("table", ["0.9.13", "0.9.14", "ue5"])
def test_255_any_is_a_query_and_no_data(table: str) -> None:
    with pytest.raises(InputError, match="255"):
        tag_table(table).translate(np.array([255], dtype=np.uint8))


def test_rock_exists_only_in_ue5() -> None:
    assert tag_table("ue5").tag(29) is SemanticTag.Rock
    with pytest.raises(InputError, match="29"):
        tag_table("0.9.14").tag(29)


def test_translation_keeps_order_and_gives_uint8() -> None:
    out = tag_table("0.9.13").translate(np.array([7, 10, 7, 0], dtype=np.int32))
    assert out.dtype == np.uint8
    assert out.tolist() == [1, 14, 1, 0]
    assert tag_table("0.9.13").translate(np.zeros(0, dtype=np.uint32)).shape == (0,)


def test_float_tags_are_refused() -> None:
    with pytest.raises(InputError, match="must be integers"):
        tag_table("0.9.14").translate(np.array([7.0]))


def test_unknown_table_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"known: 0\.9\.13, 0\.9\.14, ue5"):
        tag_table("0.9.9")


def test_yaml_table_extends_a_named_one(tmp_path) -> None:
    file = tmp_path / "simbev.yaml"
    file.write_text("base: '0.9.14'\ntags: {29: Rock, 30: Dynamic, 31: fences, 22: null}\n")
    table = tag_table(file)
    assert [table.tag(n).name for n in (14, 29, 30, 31, 22)] == ["Car", "Rock", "Dynamic", "Fences", "Unlabeled"]
    with pytest.raises(InputError, match="32"):
        table.tag(32)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tags: {300: Car}", "0 to 255"),
        ("tags: {1: Carr}", "did you mean 'Car'"),
        ("tags: []", "a mapping of number to tag name"),
        ("tag: {1: Car}", "unknown key"),
    ],
)
def test_broken_yaml_table_says_what_is_wrong(tmp_path, text: str, message: str) -> None:
    file = tmp_path / "t.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        tag_table(file)


def test_missing_yaml_table_is_not_found(tmp_path) -> None:
    with pytest.raises(NotFoundError):
        tag_table(tmp_path / "absent.yaml")


def test_table_numbers_must_fit_a_byte() -> None:
    with pytest.raises(InputError, match="256"):
        TagTable("x", {256: SemanticTag.Car})


@pytest.mark.parametrize(
    ("text", "tag"),
    [
        ("Roads", 1),
        ("road", 1),
        ("Cars", 14),
        ("None", 0),
        ("traffic_sign", 8),
        ("bus", 16),
        ("TrafficLights", 7),
        (28, 28),
    ],
)
def test_tag_names_are_read_as_people_write_them(text: str | int, tag: int) -> None:
    assert parse_tag(text) == tag


@pytest.mark.parametrize("value", ["Buss", 30, -1])
def test_unknown_tag_is_refused(value: str | int) -> None:
    with pytest.raises(InputError, match="unknown tag"):
        parse_tag(value)
