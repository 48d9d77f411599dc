"""Every bad scene is told one thing: file, key path, value and what is allowed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import tomli_w

import rotfem
from rotfem import SceneError
from rotfem.scene import load_scene
from tests.beams import STRUCTURE

BEAM = STRUCTURE["section"]
BLADE = {"EA": 3.0, "GA2": 1.0, "GA3": 2.0, "GJ": 5.0, "EI2": 7.0, "EI3": 11.0, "mass_per_length": 13.0}
STRUCTURES = {
    "planar": {"type": "planar_beam", "length": 10.0, "section": BEAM},
    "spatial": {"type": "spatial_beam", "length": 2.0, "section": BLADE},
    "plate": {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0},
}

#: Overrides of a valid scene of each structure -> words of the error; it is of the last key, or of the one at "@".
BAD = """
[planar]
structure.lenght=1 -> did you mean "length"?
motoin={} -> did you mean "motion"?
time={end=1.0, step=0.1, stepp=1} -> @time.stepp did you mean "step"?
structure.length=-1.0 -> greater than 0
structure.length=nan -> finite
structure.length='10' -> must be a number
structure.length=true -> must be a number
structure.tip_mass=-1 -> at least 0
structure.hub_offset=[0,0,0] -> unknown key
structure.section.EA=false -> must be a number
structure.section.EA=[[0,1],[9,1]] -> it ends at 9
structure.type='planar_baem' -> did you mean "planar_beam"?
structure={} -> @structure.type required key is missing
structure=3 -> must be a table
structure={type='planar_beam', section={}} -> @structure.length required key
structure.damping.rayleigh=[0,-1] -> @structure.damping.rayleigh.1 at least 0
structure.damping=0.1 -> must be a table
motion.type='constnat' -> did you mean "constant"?
motion={type='constant'} -> @motion.speed required key is missing
motion.axis=[0,0,0] -> must be a direction
motion.axis=[0,1,0] -> planar_beam
motion.axis=[0,1] -> more entries
motion.base_acceleration=[0,0,1] -> third component
motion={type='spin_up', speed=6.0, duration=0} -> @motion.duration greater than 0
motion={type='table', table=[[0,1],[1,1],[0.5,2]]} -> @motion.table must not decrease
motion={type='table', table='no.csv'} -> @motion.table file not found
motion={type='torque', hub_inertia=1.0, pulses=[[1,1,1]]} -> @motion.pulses must end after
motion={type='torque', hub_inertia=1.0, pulses=[[0,1,1]], table=[[0,1],[1,1]]} -> @motion.table give one of
motion={type='torque', hub_inertia=1.0, coupled=1} -> @motion.coupled true or false
motion={type='callable', speed=3.0} -> @motion.speed Python function
model.theory='reisner' -> did you mean "reissner"?
model.theory='exact' -> "consistent_linear"
model.effects=['corolis'] -> did you mean "coriolis"?
model.effects='all' -> a list of coriolis
accuracy=0.001; output={error=false} -> @output.error cannot be combined with accuracy
model={frame='inertial', theory='linear'} -> @model.frame reissner
model.frame='inertial'; motion={type='torque', hub_inertia=1.0} -> @model.frame prescribed rotation
initial.tip_displacement=-10.0 -> less than the length
initial={tip_displacement=0.1, state='steady'} -> @initial.tip_displacement cannot be combined
loads.gravity=[0,0,-9.81] -> third component
loads.gravity=9.81 -> list of 2 or 3 numbers
loads.tip_force=[0,0,1] -> third component
loads.tip_force={kind='dead'} -> exactly one
loads.tip_force={value=[1,1], kind='folower'} -> @loads.tip_force.kind follower
loads.tip_moment=[1,0,0] -> one component
motion.type='table' -> @motion.speed unknown key
mesh.elements=0 -> at least 1
mesh.elements=2.0 -> integer
mesh.elements=[2,2] -> integer
mesh.degree=7 -> at most 6
mesh.cell='triangle' -> unknown key
time={end=1.0, step=0.1, tolerance=1e-4} -> @time.step not both
time={step=0.1} -> @time.end required key is missing
time={end=1.0, step=0} -> @time.step greater than 0
time={end=1.0, step=2} -> @time.step at most time.end
time={end=1.0, step=0.1, breakpoints=[-1]} -> @time.breakpoints.0 at least 0
time={end=1.0, step=0.1, breakpoints=0.5} -> @time.breakpoints must be a list
time={end=1.0, step=0.1, beta=0.3} -> @time.beta no meaning
time={end=1.0, step=0.1, scheme='newmark', gamma=0.4} -> @time.gamma at least 0.5
time={end=1.0, step=0.1, scheme='newmark', beta=0} -> @time.beta greater than 0
time={end=1.0, step=0.1, output_every=0} -> @time.output_every at least 1
time={end=1.0, step=0.1, scheme='rk4'} -> @time.scheme "generalised_alpha", "newmark", "energy_conserving", "esdirk4"
modes.count=0 -> at least 1
modes.about='deformed' -> 'undeformed'
structure.section.EA=[] -> at least two rows at different x
structure.section.EA=[[0.1,1],[2,1]] -> must start at x = 0
structure.section.EA=[[0,1],[1.2,1],[1,2],[2,2]] -> must not decrease
structure.section.EA=[[0,1],[2,0]] -> greater than 0
structure.section.EA=[[0,1],[2, nan]] -> finite
structure.section.EA=[[0,1],[2, true]] -> must be a number
structure.section.EA=[[0,1],[2]] -> more entries than 1
structure.section.EA=[[0,1,2],[2,1,2]] -> at most 2 items
structure.section.EA=[0,1] -> must be a list
structure.section={} -> nothing is not a complete
structure.section={EA=1, GA=1, EI=1} -> EA, GA, EI is not a complete
structure.section={E=2e11, nu=0.3, rho=7800, shape='circle'} -> not a complete
structure.section={E=2e11, nu=0.3, rho=7800, shape='tube', outer_radius=1, inner_radius=1} -> less than outer_radius
structure.section={E=1, nu=0, rho=1, shape='tube', outer_radius=[[0,2],[10,1]], inner_radius=1.5} -> outer_radius
structure.section={E=2e11, nu=0.6, rho=7800, shape='circle', radius=1} -> at most 0.5
structure.section={E=2e11, nu=0.3, rho=7800, shape='circel', radius=1} -> did you mean "circle"
loads={distributed={over_span=[[0,0,0],[11,0,1]]}} -> @loads.distributed.over_span 11.0: must be from 0 to the length
loads={distributed={over_span=[[0,0],[10,1]]}} -> row 1 has 2 entries
loads={distributed={over_span=[[0,0,0],[5,0,1]], value=[0,1]}} -> exactly one of
loads={distributed={over_span=[[0,0,0],[5,0,1],[4,0,1]]}} -> row 3: 4 < 5
loads={distributed={over_span_and_time=[[0,0,0,1],[5,0,0,1],[5,0,0,1]]}} -> at least two x and two t
loads={tip_force={gust={amplitude=[0,1]}}} -> @loads.tip_force.gust.0.duration missing
loads={distributed={value=[0,1], gust={amplitude=1, duration=1}}} -> @loads.distributed.gust.0.amplitude must be
loads={distributed={over_span=[[0,0,0,1],[5,0,0,1]]}} -> third component
loads={tip_force={over_span=[[0,0,0],[5,0,1]]}} -> unknown key
loads={pressure=1.0} -> needs a plate
loads={at=[{x=10.1, force=[0,1]}]} -> from 0 to the length
loads={at=[{x=[1,2], force=[0,1]}]} -> must be a number
loads={at=[{x=1.0, moment=[0,0,1]}]} -> one component
loads={at={x=1.0, force=[0,1]}} -> must be a list
loads={tip_force={harmonic={amplitude=[0,1]}}} -> frequency and per_rev
loads={tip_force={harmonic={frequency=1.0}}} -> amplitude
loads={tip_moment={harmonic={amplitude=1.0, per_rev=2}}}; motion={type='torque', hub_inertia=1} -> @loads prescribed
structure.supports={} -> unknown key
output={stations=[2,1]} -> @output.stations increase
modes.operating=[3,2] -> increase
model.all_unknowns=1 -> true or false
structure.damping.modal={lag=[0.1,1.0]} -> @structure.damping.modal.lag.1 less than 1
loads.tip_force.harmonic={amplitude=['a',1], frequency=1} -> @loads.tip_force.harmonic.0.amplitude must be a number
structure.length.unit='m' -> @structure.length not a table
structure.length=ten -> must be a number
structure.section.EA=nofile.csv -> file not found
structure.section.from='x.dat' -> unknown key
[spatial]
structure.section.format='hawc2' -> unknown key
loads.tip_moment=1 -> three components
structure.tip_inertia=[[1,2,0],[2,1,0],[0,0,1]] -> definite
structure.pretwist=[[0,0],[1,1]] -> it ends at 1
structure.section.precone='a' -> @structure.precone must be a number
structure.precone=0.1; structure.section.precone=0.1 -> given twice
structure.hub_radius=1; structure.hub_offset=[1,0,0] -> either
structure.section.mass_center=[0.1] -> more entries
structure.line=[[0,0,0],[1,0,0]]; structure.length=3 -> @structure.length arc length
structure.tip_inertia=[[1,2],[2,1]] -> symmetric 3×3
structure.masses=[{x=9, mass=1}] -> @structure.masses.0.x from 0 to the length
[plate]
model.frame='inertial' -> planar_beam
initial.tip_displacement=0.1 -> only for a planar_beam
loads.tip_moment=1 -> three components
mesh.cell='triangel' -> 'quadrilateral' or 'triangle'
mesh.elements=[2,0] -> @mesh.elements.1 at least 1
structure.nu=0.5 -> less than 0.5
structure.E1=1000000000.0 -> @structure not a complete
structure.thickness={skin=0.1} -> needs a mesh
structure.thickness=[[0,0.1],[1,0]] -> @structure.thickness.1.1 greater than 0
structure.mesh='no.msh' -> file not found
structure.point_masses=[[2,0,1]] -> @structure.point_masses.0.0 from 0 to the length
structure.line_masses={tip=0} -> @structure.line_masses.tip greater than 0
structure.line_masses=1.0 -> must be a table
"""


def cases() -> list[tuple[str, list[str], str, str]]:
    """Return structure, overrides, key and words of each."""
    found, kind = [], ""
    for line in BAD.split("\n"):
        if line.startswith("["):
            kind = line[1:-1]
        elif line:
            given, said = line.split(" -> ")
            overrides = given.split("; ")
            key, words = (said[1:].split(" ", 1)) if said.startswith("@") else (overrides[-1].split("=")[0], said)
            found.append((kind, overrides, key, words))
    return found


@pytest.mark.parametrize(("kind", "overrides", "key", "words"), cases())
def test_bad_scenes(tmp_path: Path, kind: str, overrides: list[str], key: str, words: str) -> None:
    path = tmp_path / "test.toml"
    path.write_text(tomli_w.dumps({"structure": STRUCTURES[kind], "motion": {"type": "constant", "speed": 3.0}}))
    load_scene(path)
    with pytest.raises(SceneError, match=re.escape(words)) as caught:
        rotfem.Problem.of(load_scene(path, overrides))
    assert str(caught.value).startswith("test.toml: ")
    assert caught.value.key == key or caught.value.key.startswith(f"{key}.")
