"""Main files of programs that name the small blade of `blade_decks`."""

from __future__ import annotations

from tests.blade_decks import LENGTH, TWIST

#: Key points x, y, z (m) and twist (degrees) of a straight blade.
PRIMARY = [[0.0, 0.0, 0.0, 12.0], [0.0, 0.0, 8.0, 5.0], [0.0, 0.0, 20.0, -1.5]]


def beamdyn_primary(points: list[list[float]], blade: str = "blade.dat") -> str:
    """Return BeamDyn's primary file with key points x, y, z (m) and twist (degrees)."""
    rows = "\n".join(" ".join(f"{value:.10e}" for value in row) for row in points)
    return f"""--------- BEAMDYN with OpenFAST INPUT FILE -------------------------------------------
a small blade
---------------------- SIMULATION CONTROL --------------------------------------
False          Echo            - Echo input data (flag)
---------------------- GEOMETRY PARAMETER --------------------------------------
          1   member_total    - Total number of members (-)
         {len(points)}   kp_total        - Total number of key points (-) [must be at least 3]
     1     {len(points)}                 - Member number; Number of key points in this member
     kp_xr            kp_yr            kp_zr           initial_twist
      (m)              (m)              (m)              (deg)
{rows}
---------------------- MATERIAL PARAMETER --------------------------------------
"{blade}"    BldFile - Name of file containing properties for blade (quoted string)
"""


def bmodes_main(properties: str = "blade.dat") -> str:
    """Return BModes' main file."""
    factors = ["sec_mass", "flp_iner", "lag_iner", "flp_stff", "edge_stff", "tor_stff", "axial_stff"]
    factors += [f"{center}_offst" for center in ("cg", "sc", "tc")]
    tip = ["tip_mass", "cm_loc", *(f"i{axes}_tip" for axes in ("xx", "yy", "zz", "xy", "zx", "yz"))]
    return "\n".join(
        [
            "======================   BModes v1.03 Main Input File  ==================",
            "a small blade",
            "1         beam_type   1: blade, 2: tower (-)",
            "60.0      romg:       rotor speed",
            f"{LENGTH + 1.5}      radius:     rotor tip radius",
            "1.5       hub_rad:    hub radius",
            "3.0        precone:    built-in precone angle (deg)",
            "0.        bl_thp:     blade pitch setting (deg)",
            "1         hub_conn:   hub-to-blade connection",
            *(f"0.        {name}    of the tip" for name in tip),
            "1         id_mat:     material_type",
            f"'{properties}' sec_props_file   name of beam section properties file (-)",
            *(f"{2.0 if name == 'sec_mass' else 1.0}       {name}_mult:   multiplier" for name in factors),
        ]
    )


def hawc2_htc(st: str = "blade.st") -> str:
    """Return HAWC2's input file with a tower and the blade with a full matrix, half a line beside the body's axis."""
    rows = "\n".join(
        f"      sec {i} 0.02 -0.01 {z:.6f} {-twist:.6f} ; x, y, z, twist"
        for i, (z, twist) in enumerate(zip((0.0, LENGTH), TWIST, strict=True), start=1)
    )
    return f"""; a small turbine
begin new_htc_structure;
  begin main_body;  tower
    name tower ;
    type timoschenko ;
    concentrated_mass 1 0.0 0.0 0.0 100.0 0.0 0.0 0.0 ;
  end main_body;
  begin main_body;
    name        blade1 ;
    type        timoschenko ;
    nbodies     10 ;
    begin timoschenko_input ;
      filename ./{st} ;
      FPM 1 ;
      set 1 1 ;
    end timoschenko_input;
    begin c2_def;
      nsec 2 ;
{rows}
    end c2_def ;
  end main_body;
  begin main_body;
    name blade2 ;
    copy_main_body blade1;
  end main_body;
end new_htc_structure;
"""


def elastodyn_main(blade: str = "blade.dat") -> str:
    """Return ElastoDyn's main file of a rotor that is coned upwind."""
    return f"""------- ELASTODYN v1.03.* INPUT FILE -------------------------------------------
a small turbine
---------------------- TURBINE CONFIGURATION -----------------------------------
3                      NumBl       - Number of blades (-)
{LENGTH + 1.5}                   TipRad      - The distance from the rotor apex to the blade tip (meters)
1.5                    HubRad      - The distance from the rotor apex to the blade root (meters)
-4.0                   PreCone(1)  - Blade 1 cone angle (degrees)
-4.0                   PreCone(2)  - Blade 2 cone angle (degrees)
---------------------- MASS AND INERTIA ----------------------------------------
7.0                    TipMass(1)  - Tip-brake mass, blade 1 (kg)
---------------------- BLADE ---------------------------------------------------
"{blade}" BldFile1    - Name of file containing properties for blade 1 (quoted string)
"""


def beamdyn_driver(primary: str = "primary.dat") -> str:
    """Return the input file of BeamDyn's driver."""
    return f"""------- BEAMDYN Driver with OpenFAST INPUT FILE --------------------------------
a small blade
---------------------- FRAME PARAMETER --------------------------------------
          0   GlbPos(1)     - Component of position vector of the reference blade frame along X direction (m)
---------------------- PRIMARY INPUT FILE --------------------------------------
"{primary}"    InputFile - Name of the primary BeamDyn input file
"""


def openfast(elasticity: int) -> str:
    """Return OpenFAST's main file with the blades of ElastoDyn (1) or BeamDyn (2)."""
    return f"""------- OpenFAST INPUT FILE -------------------------------------------
a small turbine
---------------------- FEATURE SWITCHES AND FLAGS ------------------------------
          {elasticity}   CompElast       - Compute structural dynamics (switch)
---------------------- INPUT FILES ---------------------------------------------
"main.dat"      EDFile          - Name of file containing ElastoDyn input parameters (quoted string)
"primary.dat"   BDBldFile(1)    - Name of file containing BeamDyn input parameters for blade 1 (quoted string)
"""
