# %% [markdown]
# # A spinning disk
#
# A saw blade is a thin disk of steel, clamped at its inner edge. The guide of the saw pushes on it, at rest in space.
# At which speed does that push become dangerous? The scene is `demos/disk_campbell.toml`:
#
# ```{literalinclude} ../../demos/disk_campbell.toml
# :language: toml
# :start-at: "[structure]"
# ```
#
# The mesh is made by `meshes/annular_disk.py`; the [plate tutorial](plate.py) makes one from the beginning.

# %%
import rotfem

diagram = rotfem.campbell("../../demos/disk_campbell.toml", "0:310:6", orders=3)
for critical in diagram.critical_speeds:
    if critical.kind == "backward":
        print(f"{critical.label}: stands still in space at {critical.speed:.2f} rad/s")

# %% [markdown]
# Modes of a disk with m nodal diameters come in pairs. Seen from the disk both have the frequency ω(Ω), which the
# tension from the spin raises. Together they are waves that run around it, one with the spin and one against it. Seen
# from the fixed frame their frequencies are ω + mΩ and ω − mΩ. Where the backward wave stands still, at ω = mΩ, a force
# that rests in space feeds it without end. With m = 0 and 1 there is no such speed.

# %%
diagram.plot()

# %%
diagram.plot(drawing="campbell_fixed")

# %% [markdown]
# ## Is it right?
#
# Kirchhoff's plate with the exact stresses of a spinning disk has 213.464695 rad/s (Legendre–Ritz, 14 functions of the
# radius). Mindlin's plate, which this is, is softer by 5e-4 at this thickness.

# %%
lowest = min(c.speed for c in diagram.critical_speeds if c.kind == "backward")
assert abs(lowest - 213.464695) < 0.12
