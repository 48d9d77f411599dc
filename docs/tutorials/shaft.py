# %% [markdown]
# # ROSS's rotor, from file to unbalance response
#
# A steel shaft with two disks runs on two bearings. At which speeds will an unbalance break it? The rotor is the
# example of the program ROSS, in a file that ROSS has written by `rotor_example().save("rotor.toml")`:
#
# ```{literalinclude} ../../tests/reference/ross_rotor_example.toml
# :language: toml
# :lines: 112-118,130-140
# ```
#
# `rotfem import rotor.toml -o shaft.toml` makes a scene of it; in Python:

# %%
import rotfem

scene = rotfem.import_blade("../../tests/reference/ross_rotor_example.toml", changes=["motion.speed=200.0"])
print(*scene.hints, sep="\n")
print(scene.structure.section.given)
print(*scene.structure.supports, sep="\n")

# %% [markdown]
# Three keys make a shaft of a beam. `axis = [1, 0, 0]` spins it about its own axis. `root = { driven = true }` lets the
# drive hold it along and about that axis alone. `supports` are the bearings. ROSS's axes z, x, y are 1, 2, 3 here.
#
# ## At which speeds?
#
# On the command line this is `rotfem campbell shaft.toml --speeds 0:400:9`.

# %%
diagram = rotfem.campbell(scene, "0:400:9")
for critical in diagram.critical_speeds:
    if critical.kind != "per_rev":
        print(f"{critical.kind:8s} whirl, {critical.label:20s} {critical.speed:8.3f} rad/s")

# %% [markdown]
# A shaft whirls forward, with its spin, or backward. Gyroscopic moments of the disks raise the frequency of the one and
# lower that of the other. An unbalance turns with the shaft and drives forward whirl: the forward critical speed is the
# one to stay away from. Bearings that differ by direction, as these do, let it drive backward whirl, too.
#
# The shaft is the same in all directions, so that frequencies are those in the fixed frame. Both whirls meet the
# line 1Ω.

# %%
diagram.plot()

# %% [markdown]
# ## How far does it whirl?
#
# A gram at 1 m, or 1 kg mm, off the axis of the first disk, and bearings with some damping: one linear solution at each
# speed gives the orbits of the shaft, and the forces on its bearings. A peak has its amplification factor, as API 617
# defines it. A probe reads the displacement between the disks.

# %%
damping = {f"structure.supports.{i}.damping": 2e3 for i in (0, 1)}
damped = scene.replace({**damping, "loads.unbalance": [{"x": 0.5, "kg_m": 1e-3}]})
whirl = rotfem.unbalance(damped, "20:400:77", operating=(150.0, 200.0), probes=[(0.75, 0.0)])
for peak in whirl.summary["peaks"][:2]:
    print(f"x = {peak['x']} m: {peak['major']:.3e} m at {peak['speed']:.2f} rad/s, factor {peak['amplification']}")

# %%
whirl.plot()

# %%
whirl.plot(drawing="unbalance_orbits")

# %% [markdown]
# ## Is it right?
#
# ROSS 2.3.0 with 48 Timoshenko elements has its first two critical speeds at 91.788157 and 96.295358 rad/s. At
# 100 rad/s its first disk has the amplitudes 126.0698 and 70.49249 µm.

# %%
found = sorted(c.speed for c in diagram.critical_speeds if c.kind != "per_rev")[:2]
print(f"{found[0]:.6f} and {found[1]:.6f} rad/s, ROSS 91.788157 and 96.295358 rad/s")
disk = whirl.at(0.5)
at = list(disk["speed"]).index(100.0)
print(f"{1e6 * disk['u2'][at]:.4f} and {1e6 * disk['u3'][at]:.5f} µm, ROSS 126.0698 and 70.49249 µm")
assert abs(found[0] / 91.788157 - 1) < 2e-4
