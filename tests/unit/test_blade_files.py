"""Blade files: one blade as programs write it is one blade, and what is wrong in a file is said with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rotfem
from rotfem.accuracy.tuned import write_variant
from rotfem.scene import Scene, load_scene
from rotfem.scene.blades.windio import MOST_YAML
from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.blade_scenes import RIGID, STIFF, blade, read


def test_elastodyn(tmp_path: Path) -> None:
    beam = blade(tmp_path, decks.elastodyn(), structure_length=decks.LENGTH, **RIGID)
    section = beam.section
    np.testing.assert_allclose([v for _, v in section.mass_per_length], [1.04 * s["m"] for s in decks.STATIONS])
    np.testing.assert_allclose([v for _, v in section.EI2], [1.1 * s["EI2"] for s in decks.STATIONS])
    np.testing.assert_allclose([v for _, v in section.EI3], [0.9 * s["EI3"] for s in decks.STATIONS])
    np.testing.assert_allclose(beam.pretwist, [[0.0, -np.radians(12.0)], [20.0, np.radians(1.5)]])
    assert section.EA == 1e12


def test_columns_that_fast_shared_with_adams(tmp_path: Path) -> None:
    """Stiffness and inertias are taken where they are positive; what is left out is said; names have any case."""
    rows = decks.elastodyn().replace("EdgStff\n", "edgstff GJStff EAStff FlpIner EdgIner PrecrvRef\n")
    rows = rows.replace("(Nm^2)\n", "(Nm^2) (Nm^2) (N) (kg m) (kg m) (m)\n")
    for station, bend in zip(decks.STATIONS, (0.0, 1.5), strict=True):
        more = f"{station['GJ']:.6e} {station['EA']:.6e} {station['J2']} 0.0 {bend}"
        rows = rows.replace(f"{station['EI3']:.6e}", f"{station['EI3']:.6e} {more}")
    (tmp_path / "blade.dat").write_text(rows)
    section = {"from": "blade.dat", **STIFF}
    beam = {"type": "spatial_beam", "length": decks.LENGTH, "section": section}
    motion = {"type": "constant", "speed": 0.0}
    scene = Scene.from_dict({"structure": beam, "motion": motion}, directory=tmp_path)
    found = scene.structure.section
    for key, name in (("GJ", "GJ"), ("EA", "EA"), ("rotary_inertia2", "J2")):
        np.testing.assert_allclose([v for _, v in getattr(found, key)], [s[name] for s in decks.STATIONS])
    assert found.rotary_inertia3 is None
    assert scene.hints == ("blade.dat: left out: PrecrvRef, without which ElastoDyn computes",)
    # Damping ratios are the file's, unless the scene has damping.
    assert scene.structure.damping.modal == {"flap": (0.005,)}
    scene = scene.replace({"structure.damping": {"kelvin_voigt": 1e-3}})
    assert (scene.structure.damping.kelvin_voigt, scene.structure.damping.modal) == (1e-3, 0.0)


def test_fast_files_are_recognised_by_their_keys(tmp_path: Path) -> None:
    """Not by the words of the first line, nor by those of its encoding."""
    beam = blade(tmp_path, decks.elastodyn(), structure_length=decks.LENGTH, **RIGID)
    old = decks.elastodyn().replace("ELASTODYN V1.00", "-----").replace("a small", "une aile d'été ø")
    (tmp_path / "old.dat").write_bytes(old.encode("latin-1"))
    assert read(tmp_path, "old.dat", structure_length=decks.LENGTH, **RIGID) == beam
    beam = blade(tmp_path, decks.beamdyn_blade(), structure_length=decks.LENGTH)
    assert beam.damping.kelvin_voigt == 1e-3
    other = decks.beamdyn_blade().replace("BEAMDYN V1.00", "anything")
    assert blade(tmp_path, other, structure_length=decks.LENGTH) == beam
    (tmp_path / "bytes.dat").write_bytes(b"\0\1\2")
    with pytest.raises(rotfem.SceneError, match="cannot be read: it is no text"):
        read(tmp_path, "bytes.dat", structure_length=1.0)


def test_bmodes(tmp_path: Path) -> None:
    """The line is the elastic axis: the same blade as by centres, seen from its shear centre."""
    beam = blade(tmp_path, decks.bmodes(), structure_length=decks.LENGTH, **STIFF)
    for x, s in zip((0.0, decks.LENGTH), decks.STATIONS, strict=True):
        found = beam.section.central(x)
        for key, name in (("EA", "EA"), ("EI2", "EI2"), ("EI3", "EI3"), ("GJ", "GJ"), ("mass_per_length", "m")):
            assert found[key] == pytest.approx(s[name], rel=1e-9)
        assert found["rotary_inertia3"] == pytest.approx(s["J3"], rel=1e-9)
        np.testing.assert_allclose(beam.section.center("mass_center", x), [s["cg"][0], 0.0])
        np.testing.assert_allclose(beam.section.center("tension_center", x), [s["ec"][0] - s["sc"][0], 0.0])
    (tmp_path / "main.bmi").write_text(mains.bmodes_main())
    main = read(tmp_path, "main.bmi", **STIFF)
    of_pybmodes = mains.bmodes_main().replace("BModes v1.03 Main", "Main")
    assert blade(tmp_path, of_pybmodes, "other.bmi", **STIFF) == main
    assert (main.length, main.tip_mass) == (decks.LENGTH, 0.0)
    heavy = mains.bmodes_main().replace("0.        tip_mass", "25.        tip_mass")
    assert blade(tmp_path, heavy, "heavy.bmi", **STIFF).tip_mass == 25.0
    assert main.precone == pytest.approx(np.radians(3.0))
    # hub_rad is measured along the coned axis
    assert main.root_position == pytest.approx((1.5 * np.cos(main.precone), 0.0, 1.5 * np.sin(main.precone)))
    assert main.section.central(0.0)["mass_per_length"] == pytest.approx(600.0)


def test_columns_of_hawc2_are_interpolated_before_their_products(tmp_path: Path) -> None:
    """Young's modulus and area are linear between rows, and so EA is not."""
    head, last = decks.hawc2(False).rstrip("\n").rsplit("\n", 1)
    columns = last.split()
    columns[8] = f"{4.0 * float(columns[8]):.16e}"
    section = blade(tmp_path, f"{head}\n{' '.join(columns)}\n", "blade.st").section
    rows = np.array([head.rsplit("\n", 1)[1].split(), columns], dtype=float)

    def products(x: float) -> dict[str, float]:
        row = rows[0] + (rows[1] - rows[0]) * x / decks.LENGTH
        return {"EA": row[8] * row[15], "EI2": row[8] * row[10], "rotary_inertia3": row[1] * row[5] ** 2}

    for x in np.linspace(0.0, decks.LENGTH, 23):
        for key, middle in products(decks.LENGTH / 2).items():
            assert section.central(x)[key] == pytest.approx(products(x)[key], abs=1.2e-4 * middle)
    assert 20 < len(section.EA) < 200


# --- what is wrong is said, with its place --------------------------------------------------------------------------

LENGTH = {"structure_length": decks.LENGTH}
BAD: list[tuple[str, str, dict[str, Any], tuple[str, str], str]] = [
    (
        "elastodyn",
        "blade.dat",
        LENGTH | RIGID,
        ("3.000000e+08", "3.0x8"),
        r'line 14, column 5: "3\.0x8" must be a finite',
    ),
    (
        "elastodyn",
        "blade.dat",
        LENGTH | RIGID,
        ("3.000000e+08", "-3e8"),
        "line 14, column 5: FlpStff must be greater than 0",
    ),
    (
        "elastodyn",
        "blade.dat",
        LENGTH | RIGID,
        ("1.000000 0.25", "0.900000 0.25"),
        "line 15, column 1: BlFract must end at 1",
    ),
    (
        "elastodyn",
        "blade.dat",
        LENGTH | RIGID,
        ("EdgStff\n", "EdgeStff\n"),
        r'line 12, column 6: the column "EdgeStff" is not',
    ),
    ("elastodyn", "blade.dat", LENGTH | RIGID, ("  2   NBl", "  3   NBl"), "line 16: .*must be 6"),
    ("elastodyn", "blade.dat", LENGTH | RIGID, ("AdjBlMs", "AdjMass"), "no line with a value of AdjBlMs"),
    ("elastodyn", "blade.dat", RIGID, ("", ""), r"structure\.length.*TipRad − HubRad"),
    ("elastodyn", "blade.dat", LENGTH, ("", ""), r"structure\.section: must have EA, GA2, GA3, GJ"),
    ("elastodyn", "blade.dat", LENGTH | RIGID | {"EI2": 1.0}, ("", ""), r"section\.EI2: given twice"),
    (
        "beamdyn_blade",
        "blade.dat",
        LENGTH,
        ("2   station", "3   station"),
        "ends before the station; station_total says",
    ),
    ("beamdyn_blade", "blade.dat", LENGTH, (" 1.000000", " 0.900000"), "stations must end at 1; the last of 2 is 0.9"),
    (
        "beamdyn_blade",
        "blade.dat",
        LENGTH,
        (" 0.000000", " 0.100000"),
        "line 11, column 1: stations must increase from 0",
    ),
    ("beamdyn_blade", "blade.dat", LENGTH, ("5.0000", "5.0,"), "must be a finite number"),
    (
        "beamdyn_blade",
        "blade.dat",
        LENGTH,
        ("2   station", "two   station"),
        'line 4, column 1: station_total is "two"',
    ),
    ("beamdyn_blade", "blade.dat", {}, ("", ""), r"structure\.length.*primary file has the line"),
    ("bmodes", "blade.dat", LENGTH | STIFF, ("2  n_secs", "1  n_secs"), "line 2, column 1: n_secs"),
    ("bmodes", "blade.dat", LENGTH | STIFF, ("tc_offst", "te_offst"), "line 4: columns must be sec_loc str_tw"),
    (
        "bmodes",
        "blade.dat",
        LENGTH | STIFF,
        ("3.000000000000e+02", "0.0"),
        "line 6, column 4: mass_den must be greater",
    ),
    ("bmodes", "blade.dat", LENGTH | STIFF, ("1.000000000000e+00", "0.5"), "line 7, column 1: sec_loc must end at 1"),
    (
        "bmodes",
        "blade.dat",
        LENGTH | STIFF,
        ("1.200000000000e+01  1.2", "1.2e+01  1.3"),
        "line 6, column 3: tw_iner must be",
    ),
    ("bmodes", "blade.dat", LENGTH, ("", ""), r"structure\.section: must have GA2, GA3"),
    ("hawc2", "blade.st", {}, ("$1 2", "$1 3"), "line 8: has 0 columns; must be 30"),
    ("hawc2", "blade.st", {}, ("$1 2", "$1 1"), "line 5, column 2: must have at least two rows, not 1"),
    ("hawc2", "blade.st", {}, ("3.0000000000000000e+02", "3e2 3e2"), "line 6: has 31 columns; must be 19 with centres"),
    ("hawc2", "blade.st", {}, ("3.0000000000000000e+02", "-3e2"), "line 6, column 2: m must be greater than 0"),
    ("hawc2", "blade.st", {}, ("2.0000000000000000e+01  4.0", "0.0  4.0"), "line 7, column 1: r must increase"),
    ("hawc2", "blade.st", {"set": [1, 2]}, ("", ""), r"section\.set.*allowed: \[1, 1\]"),
    (
        "windio",
        "blade.yaml",
        {},
        ("name: small", 'windIO_version: "3.0"'),
        r"line 1, column 17: windIO_version is 3\.0; known are 2\.0 and 2\.1",
    ),
    ("windio", "blade.yaml", {}, ("twist: *twist", "twist: *angle"), "not valid YAML: found undefined alias"),
    (
        "windio",
        "blade.yaml",
        {},
        ("inertia_matrix", "mass_matrix"),
        r"line 14, column 9: .*six_x_six has no inertia_matrix",
    ),
    (
        "windio",
        "blade.yaml",
        {},
        ("[0.0, 0.5, 1.0]", "[0.0, 1.5, 1.0]"),
        "line 11, column 19: .* must rise from 0 to 1",
    ),
    ("windio", "blade.yaml", {}, ("[0.0, 0.5, 1.0]", "[0.0, 1.0]"), "has 2 places for 3 values"),
    ("windio", "blade.yaml", {}, ("0.0, 10.0", "zero, 10.0"), 'line 11, column 45: "zero" must be a finite number'),
    ("windio_2", "blade.yaml", {}, ("'2.0'", "'1.9'"), r"line 1, column 17: windIO_version is 1\.9; known are 2\.0"),
    ("windio_2", "blade.yaml", {}, ("Upwind", "Up"), 'line 3, column 22: assembly.rotor_orientation is "up"; must be'),
    ("windio_2", "blade.yaml", {}, ("cone_angle", "cone"), "line 6, column 5: components.hub has no cone_angle"),
    ("windio_2", "blade.yaml", {}, ("K22: [", "K22: [1.0, "), "line 19, column 13: .* has 2 places for 3 values|has 3"),
    ("windio_2", "blade.yaml", {}, ("K55: [", "K55: [1.0, "), "K55 has 3 values for 2 places"),
    (
        "windio_2",
        "blade.yaml",
        {},
        ("K11: [", "K11: [0.0, 1.0]  # ["),
        r"line 19, column 17: .*K11\[0\] is 0; must be greater",
    ),
    ("windio_2", "blade.yaml", {}, ("i_plr", "i_polar"), "inertia_matrix has no i_plr"),
    (
        "windio_2",
        "blade.yaml",
        {},
        ("elastic_prop", "elastic_mb"),
        "components.blade.structure has no elastic_properties",
    ),
    (
        "windio_2",
        "blade.yaml",
        {},
        ("mass: [", "mass: [-"),
        r"inertia_matrix\.mass\[0\] is -300; must be greater than 0",
    ),
    ("windio_2", "blade.yaml", {}, ("K44: ", "K55: "), "has no K44"),
    ("windio_2", "blade.yaml", {"structure_hub_offset": [1.0, 0.0, 0.0]}, ("", ""), "hub_offset: given twice"),
]


@pytest.mark.parametrize(("deck", "name", "more", "change", "message"), BAD)
def test_bad_files(
    tmp_path: Path, deck: str, name: str, more: dict[str, Any], change: tuple[str, str], message: str
) -> None:
    text = decks.hawc2(True) if deck == "hawc2" else getattr(decks, deck)()
    assert change[0] in text
    with pytest.raises(rotfem.SceneError, match=message) as caught:
        blade(tmp_path, text.replace(*change, 1) if change[0] else text, name, **more)
    assert "structure" in str(caught.value)


def test_a_format_is_not_guessed(tmp_path: Path) -> None:
    with pytest.raises(
        rotfem.SceneError, match=r"section\.from.*does not say which format it has; give section\.format"
    ):
        blade(tmp_path, "1 2 3\n4 5 6\n", "x.dat", structure_length=1.0)
    with pytest.raises(rotfem.SceneError, match=r'section\.format = "hawk2": did you mean "hawc2"'):
        blade(tmp_path, decks.hawc2(True), "x.st", format="hawk2")
    with pytest.raises(rotfem.SceneError, match="no line with a value of NBlInpSt"):
        blade(tmp_path, "1 2 3\n", "x.dat", format="elastodyn", structure_length=1.0)
    with pytest.raises(rotfem.SceneError, match=r"section\.format.*no meaning without section\.from"):
        Scene.from_dict(
            {
                "structure": {"type": "spatial_beam", "length": 1.0, "section": {"format": "hawc2"}},
                "motion": {"type": "constant", "speed": 0.0},
            }
        )
    with pytest.raises(rotfem.SceneError, match=r"section\.from.*only of a spatial_beam"):
        Scene.from_dict(
            {
                "structure": {"type": "planar_beam", "length": 1.0, "section": {"from": "x.dat"}},
                "motion": {"type": "constant", "speed": 0.0},
            }
        )


def test_paths_of_blades_move_with_a_tuned_scene(tmp_path: Path) -> None:
    """A file without an ending, too; what is no file stays."""
    (tmp_path / "blade").write_text(decks.elastodyn())
    (tmp_path / "EA.csv").write_text(f"0, 1e12\n{decks.LENGTH}, 1e12\n")
    (tmp_path / "deeper").mkdir()
    section = {"from": "blade", **RIGID, "EA": "EA.csv"}
    beam = {"type": "spatial_beam", "length": decks.LENGTH, "section": section}
    tables = {"structure": beam, "motion": {"type": "constant", "speed": 0.0}}
    scene = Scene.from_dict(tables, directory=tmp_path)
    tuned = load_scene(write_variant(scene, {"mesh.degree": 2}, tmp_path / "deeper" / "tuned.toml", ""))
    found = tuned.tables["structure"]
    assert found == {**beam, "section": {**section, "from": "../blade", "EA": "../EA.csv"}}
    assert tuned.structure == scene.structure


def test_windio_2(tmp_path: Path) -> None:
    """The hub gives root and precone, upwind against axis 3; a coordinate may have more points than the others."""
    (tmp_path / "blade.yaml").write_text(decks.windio_2())
    beam = read(tmp_path, "blade.yaml")
    assert beam.precone == pytest.approx(-np.radians(4.0))
    assert beam.root_position == pytest.approx((1.5 * np.cos(beam.precone), 0.0, 1.5 * np.sin(beam.precone)))
    bent = decks.windio_2().replace(
        "x: {grid: [0.0, 1.0], values: [0.0, 0.0]}", "x: {grid: [0.0, 0.25, 1], values: [0, 0, 3]}"
    )
    (tmp_path / "bent.yaml").write_text(bent.replace("Upwind", "downwind"))
    beam = read(tmp_path, "bent.yaml")
    assert beam.precone == pytest.approx(np.radians(4.0))
    np.testing.assert_allclose(np.array(beam.line)[:, 2], [0.0, 0.0, 1.0, 3.0])
    assert "hub_radius" not in beam.model_fields_set
    heavy = decks.windio_2().replace("# no masses", "point_mass: {grid: [0.0, 0.4, 1.0], mass: [0.0, 120.0, 5.0]}")
    (tmp_path / "heavy.yaml").write_text(heavy)
    beam = read(tmp_path, "heavy.yaml")
    assert [(body.x, body.mass) for body in beam.masses] == [(pytest.approx(8.0), 120.0), (beam.length, 5.0)]


@pytest.mark.parametrize("fast", [True, False])
def test_yaml_is_read_alike_with_libyaml_and_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fast: bool
) -> None:
    """What takes longer than ten seconds is refused, without it sooner."""
    if fast and not yaml.__with_libyaml__:
        pytest.skip("PyYAML has no libyaml here")
    monkeypatch.setattr(yaml, "__with_libyaml__", fast)
    (tmp_path / "blade.yaml").write_text(decks.windio().replace("name: small", "name: &axis small\nother: *axis"))
    assert read(tmp_path, "blade.yaml").length == pytest.approx(decks.LENGTH, rel=1e-12)
    (tmp_path / "blade.yaml").write_text(decks.windio().replace("[", "[[", 1))
    with pytest.raises(rotfem.SceneError, match=r"line \d+.*not valid YAML"):
        read(tmp_path, "blade.yaml")
    (tmp_path / "blade.yaml").write_text(decks.windio() + "#" * MOST_YAML[fast])
    with pytest.raises(rotfem.SceneError, match=f"of YAML at most {MOST_YAML[fast]} are read"):
        read(tmp_path, "blade.yaml")


def test_an_anchor_may_be_named_again(tmp_path: Path) -> None:
    """As YAML 1.2 has it: an alias is the last one before it."""
    text = decks.windio().replace("name: small", "name: &axis small\nother: *axis")
    (tmp_path / "blade.yaml").write_text(text)
    assert read(tmp_path, "blade.yaml").length == pytest.approx(decks.LENGTH, rel=1e-12)


def test_windio_2_with_axes_exchanged(tmp_path: Path) -> None:
    """Axis x along the chord, as comments of the schema have it, is seen by what is stiffer, and refused."""
    text = decks.windio_2().replace("K44", "K_").replace("K55", "K44").replace("K_", "K55")
    (tmp_path / "blade.yaml").write_text(text)
    with pytest.raises(rotfem.SceneError, match=r"K44 is less than K55 on the outer half.*x flapwise"):
        read(tmp_path, "blade.yaml")
