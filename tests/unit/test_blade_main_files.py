"""Main files of other programs: line, root and tip of a blade, and the files that they name."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import rotfem
from rotfem.commands.fields import axes_along
from tests import blade_decks as decks
from tests import blade_main_decks as mains
from tests.blade_main_decks import PRIMARY
from tests.blade_scenes import RIGID, blade, read


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
    with pytest.raises(rotfem.SceneError, match="at most 30 continue"):
        blade(tmp_path, "continue_in_file main.htc ;\n", "main.htc")


def test_import_writes_a_scene_that_is_the_blade(tmp_path: Path) -> None:
    (tmp_path / "blade.dat").write_text(decks.beamdyn_blade())
    (tmp_path / "primary.dat").write_text(mains.beamdyn_primary(PRIMARY))
    from rotfem.commands.import_blade import write_imported

    scene = rotfem.import_blade(tmp_path / "primary.dat", changes=["structure.tip_mass=3.0", "motion.speed=1.2"])
    write_imported(scene, tmp_path / "primary.dat", tmp_path / "out.toml")
    again = rotfem.load_scene(tmp_path / "out.toml")
    assert again.structure == scene.structure == read(tmp_path, "primary.dat", structure_tip_mass=3.0)
    assert (tmp_path / "out.toml").read_text().startswith("# imported from primary.dat;")
    assert again.motion.speed == 1.2
