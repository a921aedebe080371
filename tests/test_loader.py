"""The YAML loader: what it takes, what it refuses, and where it says the fault is."""

from __future__ import annotations

import pytest

from shenron_rt.config._base import ConfigModel, Vector3
from shenron_rt.config.loader import apply_overrides, parse_model, read_yaml, resolve_path
from shenron_rt.errors import ConfigError, NotFoundError


class Wheel(ConfigModel):
    radius_m: float
    name: str = "wheel"


class Cart(ConfigModel):
    carrier_hz: float = 1.0
    xyz_m: Vector3 = (0.0, 0.0, 0.0)
    wheels: tuple[Wheel, ...] = ()
    spare: Wheel | None = None


@pytest.fixture
def yaml_file(tmp_path):
    def write(text):
        file = tmp_path / "cart.yaml"
        file.write_text(text)
        return file

    return write


@pytest.mark.parametrize("text", ["77e9", "77.0e9", "77E+9", "77000000000", "'77e9'"])
def test_numbers_of_yaml_1_1_are_numbers(yaml_file, text):
    """PyYAML reads 77e9 as a string."""
    assert parse_model(Cart, yaml_file(f"carrier_hz: {text}\n")).carrier_hz == 77e9


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("carrier_hz: 1\ncarrier_hz: 2\n", 2, ["'carrier_hz' is given twice"]),
        ("carrier_hz: 1\nwheels:\n  - radius_m: 1\n    radius_m: 2\n", 4, ["'radius_m' is given twice"]),
        ("carrier_hz: 1\ncarier: 2\n", 2, ["carier", "did you mean 'carrier_hz'"]),
        ("wheels:\n  - radius_m: 1\n  - radius_m: 1\n    nam: x\n", 4, ["wheels.1.nam", "did you mean 'name'"]),
        ("spare:\n  radius_m: 1\n  nam: x\n", 3, ["spare", "nam", "did you mean 'name'"]),
        ("wheels:\n  - name: x\n", 2, ["wheels.0.radius_m"]),
        ("carrier_hz: fast\n", 1, ["carrier_hz", "got 'fast'"]),
        ("carrier_hz: .nan\n", 1, ["carrier_hz", "finite"]),
        ("xyz_m: [1, 2]\n", 1, ["xyz_m", "three numbers are needed, got 2"]),
        ("a: [1\nb: 2\n", 2, ["not valid YAML"]),
        ("- 1\n- 2\n", 1, ["a mapping of keys is needed, got a list"]),
        ("? [a, b]\n: 3\n", 1, ["not valid YAML", "cannot be read"]),
        ("carrier_hz: 1\nspare: {radius_m: 1, name: 2020-13-45}\n", 2, ["not valid YAML", "month"]),
        ("carrier_hz: 1\nspare: {radius_m: !!int x}\n", 2, ["not valid YAML", "'x'"]),
        ("wheels: [&w {radius_m: 1}]\nspare:\n  <<: *w\n  radius_m: wide\n", 4, ["spare.radius_m", "got 'wide'"]),
    ],
)
def test_faults_are_reported_with_file_line_and_key(yaml_file, text, line, words):
    file = yaml_file(text)
    with pytest.raises(ConfigError) as caught:
        parse_model(Cart, file)
    message = str(caught.value)
    assert message.startswith(f"{file}:{line}:")
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wheels: " + "[" * 900 + "]" * 900 + "\n", "nested too deep"),
        ("wheels: " + "[" * 100_000 + "]" * 100_000 + "\n", "nest"),
        ("wheels: &w [*w]\n", "recursive"),
        ("name: \x00\n", "control characters are not allowed"),
    ],
)
def test_texts_made_to_break_a_parser_are_one_line(yaml_file, text, words):
    with pytest.raises(ConfigError, match=words) as caught:
        read_yaml(yaml_file(text))
    assert "\n" not in str(caught.value)


def test_every_fault_is_listed_at_once(yaml_file):
    with pytest.raises(ConfigError) as caught:
        parse_model(Cart, yaml_file("carrier_hz: fast\nxyz_m: 3\nwheel: 1\n"))
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert [line.split(":")[1] for line in sorted(lines)] == ["1", "2", "3"]


@pytest.mark.parametrize(
    "text",
    [
        "carrier_hz: !!python/object/apply:os.system ['touch owned']\n",
        "!!python/object/new:os.system ['touch owned']\n",
        "carrier_hz: !!python/name:os.system\n",
    ],
)
def test_python_tags_are_refused_and_nothing_runs(yaml_file, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="not valid YAML"):
        parse_model(Cart, yaml_file(text))
    assert not (tmp_path / "owned").exists()


def test_missing_and_binary_files_are_told_apart(tmp_path):
    with pytest.raises(NotFoundError, match=r"gone\.yaml"):
        read_yaml(tmp_path / "gone.yaml")
    with pytest.raises(NotFoundError):
        read_yaml(tmp_path)
    (tmp_path / "bin.yaml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ConfigError, match="UTF-8"):
        read_yaml(tmp_path / "bin.yaml")


def test_empty_file_is_an_empty_mapping(yaml_file):
    assert parse_model(Cart, yaml_file("# nothing\n")) == Cart()


def test_anchors_and_merges_work(yaml_file):
    cart = parse_model(Cart, yaml_file("spare: &w {radius_m: 0.3, name: a}\nwheels:\n  - {<<: *w, name: b}\n  - *w\n"))
    assert [w.name for w in cart.wheels] == ["b", "a"]
    assert cart.wheels[0].radius_m == 0.3


def test_overrides_reach_into_lists_and_groups(yaml_file):
    file = yaml_file("wheels:\n  - radius_m: 1\n  - radius_m: 2\n")
    cart = parse_model(Cart, file, {"wheels.1.radius_m": "3e-1", "spare.radius_m": 4, "xyz_m": "[1, 2, 3]"})
    assert [w.radius_m for w in cart.wheels] == [1, 0.3]
    assert cart.spare is not None
    assert cart.spare.radius_m == 4
    assert cart.xyz_m == (1, 2, 3)


def test_overrides_leave_the_given_data_alone():
    data = {"a": {"b": [1, 2]}}
    assert apply_overrides(data, {"a.b.0": 9}) == {"a": {"b": [9, 2]}}
    assert data == {"a": {"b": [1, 2]}}


@pytest.mark.parametrize("key", ["wheels.5.radius_m", "wheels.x", "carrier_hz.deep"])
def test_overrides_that_lead_nowhere_are_refused(key):
    with pytest.raises(ConfigError, match="--set"):
        apply_overrides({"wheels": [{"radius_m": 1}], "carrier_hz": 1.0}, {key: 1})


def test_paths_may_not_climb_out_of_their_folder(tmp_path):
    inside, outside = tmp_path / "in" / "a.obj", tmp_path / "b.obj"
    inside.parent.mkdir()
    for file in (inside, outside):
        file.write_text("x")
    assert resolve_path("a.obj", inside.parent, "mesh").read_text() == "x"
    assert resolve_path(str(outside), inside.parent, "mesh") == outside
    with pytest.raises(ConfigError, match=r"mesh: '\.\./b\.obj' leaves the folder"):
        resolve_path("../b.obj", inside.parent, "mesh")
    with pytest.raises(NotFoundError, match="mesh"):
        resolve_path("c.obj", inside.parent, "mesh")
    (inside.parent / "link.obj").symlink_to(outside)
    with pytest.raises(ConfigError, match="leaves the folder"):
        resolve_path("link.obj", inside.parent, "mesh")
