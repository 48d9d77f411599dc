"""Blade files: one blade as programs write it is one blade, and what is wrong in a file is said with its line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rotfem
from rotfem.commands.fields import axes_along
from rotfem.scene import Scene, load_scene
from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.blade_main_decks import PRIMARY
from tests.blade_scenes import RIGID, STIFF, blade, read


def test_elastodyn(tmp_path: Path) -> None:
    beam = blade(tmp_path, decks.elastodyn(), structure_length=decks.LENGTH, **RIGID)
    section = beam.section
    np.testing.assert_allclose([v for _, v in section.mass_per_length], [1.04 * s["m"] for s in decks.STATIONS])
    np.testing.assert_allclose([v for _, v in section.EI2], [1.1 * s["EI2"] for s in decks.STATIONS])
    np.testing.assert_allclose([v for _, v in section.EI3], [0.9 * s["EI3"] for s in decks.STATIONS])
    np.testing.assert_allclose(beam.pretwist, [[0.0, -np.radians(12.0)], [20.0, np.radians(1.5)]])
    assert section.EA == 1e12


def test_rigid_is_what_a_file_leaves_open(tmp_path: Path) -> None:
    """Bending alone is left: frequencies are those with other large stiffnesses; of a file, what it has stays."""
    (tmp_path / "blade.dat").write_text(decks.elastodyn())
    with pytest.raises(rotfem.SceneError, match=r"must have EA, GA2, GA3, GJ, or rigid = true \(import --rigid\)"):
        rotfem.import_blade(tmp_path / "blade.dat", changes=["structure.length=20"])
    scene = rotfem.import_blade(tmp_path / "blade.dat", changes=["structure.length=20", "modes.count=3"], rigid=True)
    assert scene.hints[0].startswith("blade.dat: rigid: EA = ")
    assert scene.output.frequency == "Hz"
    more = scene.replace({f"structure.section.{key}": 30.0 * getattr(scene.structure.section, key) for key in STIFF})
    one, other = (rotfem.modes(s, error=False).frequencies for s in (scene, more))
    np.testing.assert_allclose(one, other, rtol=1e-5)


def test_a_static_file_without_mass(tmp_path: Path) -> None:
    """Its deflection under a force is that of the blade with its mass."""
    heavy = decks.beamdyn_blade()
    numbers = iter(range(10**6))
    light = "\n".join(
        "0 0 0 0 0 0" if len(line.split()) == 6 and "e+" in line and next(numbers) % 12 >= 6 else line
        for line in heavy.split("\n")
    )
    tips = []
    for text in (heavy, light):
        (tmp_path / "blade.dat").write_text(text)
        scene = rotfem.import_blade(tmp_path / "blade.dat", changes=["structure.length=20"], rigid=True)
        tips.append(rotfem.run(scene.replace({"loads.tip_force": [0, 0, 1e4]}), error=False).tip["u3"][-1])
    assert tips[1] == pytest.approx(tips[0], rel=1e-9)


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

#: Names of files ↦ their text.
FILES = {
    "elastodyn.dat": decks.elastodyn(),
    "beamdyn.dat": decks.beamdyn_blade(),
    "bmodes.dat": decks.bmodes(),
    "full.st": decks.hawc2(True),
    "one.yaml": decks.windio(),
    "two.yaml": decks.windio_2(),
    "main.fst": mains.openfast(2),
    "main.dat": mains.elastodyn_main("elastodyn.dat"),
    "primary.dat": mains.beamdyn_primary(PRIMARY, "beamdyn.dat"),
    "driver.inp": mains.beamdyn_driver(),
    "main.bmi": mains.bmodes_main("bmodes.dat"),
    "main.htc": mains.hawc2_htc().replace("blade.st", "full.st"),
}
KEYS = {"length": {"structure_length": decks.LENGTH}, "rigid": RIGID, "stiff": STIFF, "one": {"body": "blade1"}}
KEYS |= {"two": {"body": "blade2"}, "hub": {"structure_hub_offset": [1.0, 0.0, 0.0]}, "EI2": {"EI2": 1.0}}
KEYS |= {"set": {"set": [1, 2]}, "tower": {"body": "tower"}, "none": {"body": "blade3"}, "three": {"body": 3}}

#: A file, keys that the scene has beside it, a text in the file => another one, and words of what the error says.
BAD = r"""
elastodyn.dat length rigid | 3.000000e+08 => 3.0x8 | line 14, column 5: must be a finite
elastodyn.dat length rigid | 3.000000e+08 => -3e8 | section.EI2.0.1 = -330000000.0: must be greater than 0
elastodyn.dat length rigid | 1.000000 0.25 => 0.900000 0.25 | BlFract must rise from 0 to 1
elastodyn.dat length rigid | EdgStff\n => EdgeStff\n | line 12, column 6: the column "EdgeStff" is not known
elastodyn.dat length rigid |   2   NBl =>   3   NBl | line 16: has 5 columns; must be 6
elastodyn.dat length rigid | AdjBlMs => AdjMass | no line with a value of AdjBlMs
elastodyn.dat rigid |  | is a part of TipRad − HubRad
elastodyn.dat length |  | structure.section: must have EA, GA2, GA3, GJ
elastodyn.dat length rigid EI2 |  | section.EI2: given twice
beamdyn.dat length | 2   station => 3   station | ends before station 3 is complete; station_total says
beamdyn.dat length |  1.000000 =>  0.900000 | the stations must rise from 0 to 1
beamdyn.dat length |  0.000000 =>  0.100000 | line 11, column 1: the stations must rise from 0
beamdyn.dat length | 5.0000 => 5.0, | must be a finite number
beamdyn.dat length | 2   station => two   station | line 4, column 1: station_total must be
beamdyn.dat |  | BeamDyn's primary file has the line
bmodes.dat length stiff | 2  n_secs => 1  n_secs | line 2, column 1: n_secs
bmodes.dat length stiff | tc_offst => te_offst | line 4, column 13: the column "te_offst" is not known
bmodes.dat length stiff | 3.000000000000e+02 => -1.0 | section.mass_per_length.0.1 = -1.0: must be
bmodes.dat length stiff | 1.000000000000e+00 => 0.5 | sec_loc must rise from 0 to 1
bmodes.dat length stiff | 1.200000000000e+01  1.2 => 1.2e+01  1.3 | line 6: tw_iner must be
bmodes.dat length |  | structure.section: must have GA2, GA3
full.st | $1 2 => $1 3 | line 8: has 0 columns; must be 30
full.st | $1 2 => $1 1 | line 5, column 2: must have at least two rows, not 1
full.st | 3.0000000000000000e+02 => 3e2 3e2 | line 6: has 31 columns; must be 19 with centres
full.st | 3.0000000000000000e+02 => -3e2 | structure.section.mass = 
full.st | 2.0000000000000000e+01  4.0 => 0.0  4.0 | r must rise from 0
full.st set |  | allowed: [1, 1]
one.yaml | name: small => windIO_version: "3.0" | windIO_version is 3.0; known are 2.0 and 2.1
one.yaml | twist: *twist => twist: *angle | not valid YAML: found undefined alias
one.yaml | [ => [[ | not valid YAML
one.yaml | inertia_matrix => mass_matrix | six_x_six has no inertia_matrix
one.yaml | [0.0, 0.5, 1.0] => [0.0, 1.5, 1.0] | grid must rise from 0 to 1
one.yaml | [0.0, 0.5, 1.0] => [0.0, 1.0] | has 3 values; must have 2
one.yaml | 0.0, 10.0 => zero, 10.0 | values must be numbers: could not convert string to float: 'zero'
two.yaml | '2.0' => '1.9' | windIO_version is 1.9; known are 2.0
two.yaml | Upwind => Up | assembly.rotor_orientation is "up"; must be
two.yaml | cone_angle => cone | components.hub has no cone_angle
two.yaml | K22: [ => K22: [1.0,  | K22 has 3 values; must have 2
two.yaml | K11: [ => K11: [0.0, 1.0]  # [ | at x = 0 it must be a symmetric 6×6 matrix, positive definite
two.yaml | i_plr => i_polar | inertia_matrix has no i_plr
two.yaml | elastic_prop => elastic_mb | components.blade.structure has no elastic_properties
two.yaml | mass: [ => mass: [- | at x = 0 it must be a symmetric 6×6 matrix, positive semi
two.yaml | K44:  => K55:  | has no K44
two.yaml hub |  | hub_offset: given twice
main.fst | 2   Comp => 3   Comp | line 4, column 1: CompElast = 3 is not known; known: 1
main.fst | 2   Comp => two   Comp | line 4, column 1: CompElast must be a whole number
main.fst | main.dat => none.dat | line 6: there is no file "none.dat" beside it
main.fst | main.dat => elastodyn.dat | no line with a value of TipMass
main.fst | primary.dat =>  | line 7: there is no file "" beside it
primary.dat | beamdyn.dat => none.dat | line 15: there is no file "none.dat" beside it
primary.dat | 1   member_total => 2   member_total | line 6, column 1: has 2 members
primary.dat | kp_total => kp_number | no line with a value of kp_total
driver.inp | primary.dat => none.dat | line 6: there is no file "none.dat" beside it
main.bmi stiff | v1.03 => v9.00 | line 1: the version of BModes' main file is 9.00
main.bmi stiff | 0.        bl_thp => 2.        bl_thp | line 8, column 1: bl_thp = 2 is not known; only 0
main.bmi stiff | 0.        ixx_tip => 5.        ixx_tip | line 12, column 1: ixx_tip is not read
main.bmi stiff | 1.5       hub_rad => 30       hub_rad | structure.length = 
main.bmi stiff | sec_props_file => properties | no line with a value of sec_props_file
main.bmi stiff | 'bmodes.dat' => 'none.dat' | there is no file "none.dat" beside it
main.htc |  | section.body: must say which of the main bodies of main.htc: "tower", "blade1", "blade2"
main.htc none |  | section.body = "blade3": is not in main.htc; allowed: "tower"
main.htc three |  | section.body = 3: must be the name of a main body
main.htc tower |  | line 6: concentrated_mass is not read; take it out
main.htc one | type        timo => type        notimo | line 10, column 2: the type notimoschenko is not
main.htc one | FPM 1 => FPM 0 | line 6: has 30 columns; must be 19 with centres, as FPM 0
main.htc one | nsec 2 => nsec 3 | line 18, column 2: nsec is 3, at least 2, and there are 2 lines of sec
main.htc one | sec 2 0.02 => sec 2 0.x2 | line 20, column 3: must be a finite number
main.htc one | full.st => none.st | line 13, column 2: there is no file "./none.st"
main.htc one | set 1 1 => set 1 2 | allowed: [1, 1]
main.htc one | set 1 1 ; =>  | line 8: the main body has no set
main.htc two | copy_main_body blade1 => copy_main_body blade2 | copy each other in a circle
main.dat rigid | HubRad  => HubRadius  | no line with a value of HubRad
main.dat rigid | \n1.5  => \n31.5  | structure.length = -10.0: must be greater than 0
main.dat rigid | -4.0 => four | line 7, column 1: must be a finite number
main.dat rigid | 7.0  => -7.0  | structure.tip_mass = -7.0: must be at least 0
main.dat rigid | BldFile1 => BldFile | no line with a value of BldFile(1)
"""


@pytest.mark.parametrize("case", BAD.strip("\n").split("\n"))
def test_bad_files(tmp_path: Path, case: str) -> None:
    given, change, message = case.split(" | ")
    name, *more = given.split()
    for other, text in FILES.items():
        (tmp_path / other).write_text(text)
    old, _, new = change.replace("\\n", "\n").partition(" => ")
    assert old in FILES[name]
    keys = {key: value for which in more for key, value in KEYS[which].items()}
    with pytest.raises(rotfem.SceneError) as caught:
        blade(tmp_path, FILES[name].replace(old, new, 1), name, **keys)
    assert message in str(caught.value)
    assert "structure" in caught.value.key


def test_a_format_is_not_guessed(tmp_path: Path) -> None:
    with pytest.raises(
        rotfem.SceneError, match=r"section\.from.*does not say which format it has; give section\.format"
    ):
        blade(tmp_path, "1 2 3\n4 5 6\n", "x.dat", structure_length=1.0)
    with pytest.raises(rotfem.SceneError, match=r'section\.format = "hawk2": did you mean "hawc2"'):
        blade(tmp_path, decks.hawc2(True), "x.st", format="hawk2")
    with pytest.raises(rotfem.SceneError, match="no line with a value of NBlInpSt"):
        blade(tmp_path, "1 2 3\n", "x.dat", format="elastodyn", structure_length=1.0)


def test_paths_of_blades_move_with_a_tuned_scene(tmp_path: Path) -> None:
    """A file without an ending, too; what is no file stays."""
    (tmp_path / "blade").write_text(decks.elastodyn())
    (tmp_path / "EA.csv").write_text(f"0, 1e12\n{decks.LENGTH}, 1e12\n")
    (tmp_path / "deeper").mkdir()
    section = {"from": "blade", **RIGID, "EA": "EA.csv"}
    beam = {"type": "spatial_beam", "length": decks.LENGTH, "section": section}
    tables = {"structure": beam, "motion": {"type": "constant", "speed": 0.0}}
    scene = Scene.from_dict(tables, directory=tmp_path)
    tuned = load_scene(scene.replace({"mesh.degree": 2}).write(tmp_path / "deeper" / "tuned.toml"))
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
def test_yaml_with_libyaml_and_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fast: bool) -> None:
    """An anchor may be named again, as YAML 1.2 has it: an alias is the last one before it."""
    monkeypatch.setattr(yaml, "__with_libyaml__", fast and yaml.__with_libyaml__)
    text = decks.windio().replace("name: small", "name: &axis small\nother: *axis")
    assert blade(tmp_path, text, "blade.yaml").length == pytest.approx(decks.LENGTH, rel=1e-12)


def test_windio_2_with_axes_exchanged(tmp_path: Path) -> None:
    """Axis x along the chord, as comments of the schema have it, is seen by what is stiffer, and refused."""
    text = decks.windio_2().replace("K44", "K_").replace("K55", "K44").replace("K_", "K55")
    with pytest.raises(rotfem.SceneError, match=r"K44 is less than K55 on the outer half.*x flapwise"):
        blade(tmp_path, text, "blade.yaml")


# --- matrices: one blade in five formats, and matrices that no section has --------------------------------------------


def along_ours(matrix: Any) -> Any:
    """Return a matrix in axes 1, 2, 3 = z, −y, x from one in x, y, z: entry by entry."""
    place, sign = [2, 1, 0, 5, 4, 3], np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    return np.asarray(matrix)[np.ix_(place, place)] * np.outer(sign, sign)


def test_one_blade_in_four_formats(tmp_path: Path) -> None:
    """Matrices at root and tip are those of sums over centres in IEC axes; pretwist is −twist."""
    (tmp_path / "windio.yaml").write_text(decks.windio())
    (tmp_path / "windio2.yaml").write_text(decks.windio_2())
    beams = {
        "beamdyn": blade(tmp_path, decks.beamdyn_blade(), structure_length=decks.LENGTH),
        "hawc2 full": blade(tmp_path, decks.hawc2(True), "full.st"),
        "hawc2": blade(tmp_path, decks.hawc2(False), "centres.st"),
        "windio": read(tmp_path, "windio.yaml"),
        "windio 2": read(tmp_path, "windio2.yaml"),
    }
    for name, beam in beams.items():
        assert beam.length == pytest.approx(decks.LENGTH, rel=1e-12)
        for x, station, angle in zip((0.0, decks.LENGTH), decks.STATIONS, decks.ANGLE, strict=True):
            at = beam.section.at(x)
            for key, matrix in zip(("stiffness", "mass"), decks.iec_matrices(station, angle), strict=True):
                wanted = along_ours(matrix)
                scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
                assert np.max(np.abs(at[key] - wanted) / scale) < 1e-12, (name, key, x)
    for name in ("windio", "windio 2"):
        twist = np.array(beams[name].pretwist)
        np.testing.assert_allclose(twist[[0, -1], 1], -np.radians(decks.TWIST), rtol=1e-12)


def number(i: int, j: int, which: int) -> str:
    """Return an entry of the matrix at the root as the decks write it, of stiffness (0) or mass (1)."""
    return f"{decks.iec_matrices(decks.STATIONS[0], decks.ANGLE[0])[which][i, j]:.16e}"


@pytest.mark.parametrize(
    ("deck", "name", "which", "entry", "message"),
    [
        ("beamdyn_blade", "blade.dat", 0, 0, "section.stiffness = .*at x = 0 it must be"),
        ("beamdyn_blade", "blade.dat", 1, 5, "section.mass = .*at x = 0 it must be"),
        ("windio", "blade.yaml", 0, 0, "section.stiffness = .*at x = 0 it must be"),
        ("windio", "blade.yaml", 1, 5, "section.mass = .*at x = 0 it must be"),
        ("windio_2", "blade.yaml", 1, 5, "section.mass = .*at x = 0 it must be"),
    ],
)
def test_a_matrix_that_no_section_has(
    tmp_path: Path, deck: str, name: str, which: int, entry: int, message: str
) -> None:
    """Without shear stiffness, or with less inertia in torsion than its offset from the line makes, m y² + m z²."""
    text: str = getattr(decks, deck)()
    old = number(entry, entry, which)
    assert old in text
    more: dict[str, Any] = {"structure_length": decks.LENGTH} if name == "blade.dat" else {}
    with pytest.raises(rotfem.SceneError, match=message):
        blade(tmp_path, text.replace(old, "0.0" if which == 0 else "0.5", 1), name, **more)


# --- main files: line, root and tip, and the files that they name -----------------------------------------------------


def test_beamdyn_with_its_line(tmp_path: Path) -> None:
    """x is axis 3, y −2, z 1; without sweep the sections are turned by −twist, with it by a little more."""
    (tmp_path / "blade.dat").write_text(decks.beamdyn_blade())
    bent = [[0.0, 0.0, 0.0, 12.0], [-0.1, 0.0, 8.0, 5.0], [-0.5, 0.0, 15.0, 1.0], [-1.2, 0.0, 20.0, -1.5]]
    beam = blade(tmp_path, mains.beamdyn_primary(bent), "primary.dat")
    np.testing.assert_allclose(beam.line, [[z, -y, x] for x, y, z, _ in bent], atol=1e-12)
    np.testing.assert_allclose(
        [a for _, a in np.array(beam.pretwist)], -np.radians([row[3] for row in bent]), atol=1e-12
    )
    assert np.array(beam.section.stiffness[-1][0]) == pytest.approx(beam.length, rel=1e-12)
    swept = [[x, 0.1 * z * z / 20, z, twist] for x, _, z, twist in bent]
    beam = blade(tmp_path, mains.beamdyn_primary(swept), "primary.dat")
    line = beam.reference_line
    assert line is not None
    T = axes_along(beam, np.array([x for x, _ in beam.pretwist]), np.eye(3))
    for axes, (*_, twist) in zip(T, swept, strict=True):
        # Turned back by the twist about −z, x (our section axis 3) has no component along y (−2).
        back = np.radians(twist)
        x = np.cos(back) * axes[:, 2] - np.sin(back) * axes[:, 1]
        assert abs(x[1]) < 1e-12


def test_main_file_of_elastodyn(tmp_path: Path) -> None:
    """Length, root, precone and tip mass of blade 1, and its blade file."""
    (tmp_path / "blade.dat").write_text(decks.elastodyn())
    alone = read(tmp_path, "blade.dat", structure_length=decks.LENGTH, **RIGID)
    for change in (
        ("", ""),
        ("BldFile1", "BldFile(1)"),
        ('"blade', '".\\blade'),
        ("ELASTODYN v1.03.* INPUT", "FAST v7.02 INPUT"),
        ('"blade', '"BLADE'),
    ):
        beam = blade(tmp_path, mains.elastodyn_main().replace(*change, 1), "main.dat", **RIGID)
        assert (beam.section, beam.pretwist, beam.length) == (alone.section, alone.pretwist, decks.LENGTH)
        assert (beam.precone, beam.tip_mass) == (pytest.approx(-np.radians(4.0)), 7.0)
        assert beam.root_position == pytest.approx((1.5 * np.cos(beam.precone), 0.0, 1.5 * np.sin(beam.precone)))


def test_pitch_damping_and_what_is_left_out(tmp_path: Path) -> None:
    """Pitch is about −z there; of what has no key, or another one, the name and the number are said."""
    openfast_files(tmp_path, decks.beamdyn_blade().replace("0.001 0.001 0.001 0", "0.001 0.001 0.002 0"))
    main = mains.elastodyn_main().replace("--- BLADE", "--- BLADE\n10.0 BlPitch(1)\n12.1 RotSpeed\n---", 1)
    (tmp_path / "main.dat").write_text(main)
    (tmp_path / "main.fst").write_text(mains.openfast(2))
    scene = rotfem.import_blade(tmp_path / "main.fst")
    assert scene.structure.root.pitch.constant == pytest.approx(-np.radians(10.0))
    said = "\n".join(scene.hints)
    for words in (
        r"TipMass\(1\) = 7 kg.*structure\.tip_mass is the key",
        r"RotSpeed = 12\.1 rpm = 1\.26711 rad/s.*motion\.speed",
        r"mu1 … mu6 = 0\.001, 0\.001, 0\.002.*which differ; structure\.damping",
    ):
        assert re.search(words, said)
    assert scene.structure.damping.is_zero


def test_driver_of_beamdyn(tmp_path: Path) -> None:
    (tmp_path / "blade.dat").write_text(decks.beamdyn_blade())
    primary = blade(tmp_path, mains.beamdyn_primary(PRIMARY), "primary.dat")
    assert blade(tmp_path, mains.beamdyn_driver(), "driver.inp") == primary


def openfast_files(folder: Path, blade_file: str) -> None:
    (folder / "blade.dat").write_text(blade_file)
    (folder / "main.dat").write_text(mains.elastodyn_main())
    (folder / "primary.dat").write_text(mains.beamdyn_primary(PRIMARY))


def test_main_file_of_openfast(tmp_path: Path) -> None:
    """CompElast says whose blade it is; of a blade of BeamDyn the root is in ElastoDyn's main file."""
    openfast_files(tmp_path, decks.elastodyn())
    assert blade(tmp_path, mains.openfast(1), "main.fst", **RIGID) == read(tmp_path, "main.dat", **RIGID)
    openfast_files(tmp_path, decks.beamdyn_blade())
    beam, primary = blade(tmp_path, mains.openfast(2), "main.fst"), read(tmp_path, "primary.dat")
    assert (beam.section, beam.line, beam.pretwist) == (primary.section, primary.line, primary.pretwist)
    assert beam.precone == pytest.approx(-np.radians(4.0))
    assert beam.root_position == pytest.approx((1.5 * np.cos(beam.precone), 0.0, 1.5 * np.sin(beam.precone)))


def test_main_body_of_hawc2(tmp_path: Path) -> None:
    """A body, or a copy of it, has the st file's sections on its own line with its own twist."""
    (tmp_path / "blade.st").write_text(decks.hawc2(True))
    alone = read(tmp_path, "blade.st")
    text = mains.hawc2_htc()
    for body in ("blade1", "blade2"):
        beam = blade(tmp_path, text, "main.htc", body=body)
        for x in (0.0, 10.0):
            np.testing.assert_allclose(beam.section.at(x)["stiffness"], alone.section.at(x)["stiffness"], rtol=1e-12)
        np.testing.assert_allclose(beam.line, [[0.0, 0.0, 0.0], [decks.LENGTH, 0.0, 0.0]])
        np.testing.assert_allclose([v for _, v in np.array(beam.pretwist)], -np.radians(decks.TWIST), rtol=1e-7)


def test_sections_of_hawc2_that_end_beside_the_line(tmp_path: Path) -> None:
    """x to the leading edge is axis 2, y downwind axis 3; the last section holds to the end, up to 1 %."""
    text = mains.hawc2_htc()
    curved = text.replace("nsec 2", "nsec 3").replace("sec 2 0.02 -0.01", "sec 2 0.12 0.39 10.0 0.0\n sec 3 0.02 -0.01")
    (tmp_path / "main.htc").write_text(curved)
    for end, holds in ((20.0, True), (20.2, False), (19.7, None)):
        st = decks.hawc2(True).replace("2.0000000000000000e+01", f"{end}", 1)
        (tmp_path / "blade.st").write_text(st)
        if holds is None:
            with pytest.raises(
                rotfem.SceneError, match=r"line 15: its sections end at r = 19\.7 m, and the line .* 20\."
            ):
                read(tmp_path, "main.htc", body="blade1")
            continue
        scene = rotfem.import_blade(tmp_path / "main.htc", changes=["structure.section.body=blade1"])
        beam = scene.structure
        assert any("the last section holds up to there" in hint for hint in scene.hints)
        np.testing.assert_allclose(np.array(beam.line)[1], [10.0, 0.1, 0.4], atol=1e-12)
        rows = beam.section.stiffness
        assert rows[-1][0] == pytest.approx(beam.length, rel=1e-12)
        assert (rows[-1][1] == rows[-2][1]) == holds


def test_bodies_of_hawc2_in_another_file(tmp_path: Path) -> None:
    """Paths start at the folder of the main file or at one of the two above, but not at several."""
    (tmp_path / "htc").mkdir()
    (tmp_path / "blade.st").write_text(decks.hawc2(True))
    (tmp_path / "bodies.htc").write_text(mains.hawc2_htc() + "exit ;\nbegin nothing\n")
    main = "continue_in_file ./bodies.htc ;\n"
    beam = blade(tmp_path / "htc", main, "main.htc", body="blade1")
    assert beam.length == pytest.approx(decks.LENGTH, rel=1e-12)
    (tmp_path / "htc" / "blade.st").write_text(decks.hawc2(True))
    with pytest.raises(rotfem.SceneError, match=r"line 13, column 2: there are several files"):
        blade(tmp_path / "htc", main, "main.htc", body="blade1")
    with pytest.raises(rotfem.SceneError, match="too many files continue"):
        blade(tmp_path, "continue_in_file main.htc ;\n", "main.htc")


def test_import_writes_a_scene_that_is_the_blade(tmp_path: Path) -> None:
    (tmp_path / "blade.dat").write_text(decks.beamdyn_blade())
    (tmp_path / "primary.dat").write_text(mains.beamdyn_primary(PRIMARY))
    scene = rotfem.import_blade(tmp_path / "primary.dat", changes=["structure.tip_mass=3.0", "motion.speed=1.2"])
    scene.write(tmp_path / "out.toml", "# imported\n")
    again = rotfem.load_scene(tmp_path / "out.toml")
    assert again.structure == scene.structure == read(tmp_path, "primary.dat", structure_tip_mass=3.0)
    assert (tmp_path / "out.toml").read_text().startswith("# imported\n")
    assert again.motion.speed == 1.2
