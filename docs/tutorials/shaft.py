# %% [markdown]
# # A shaft on bearings
#
# A steel shaft with two disks runs on two bearings. At which speeds will an unbalance break it? The scene is
# `demos/shaft_on_bearings.toml`, the example rotor of the program ROSS:
#
# ```{literalinclude} ../../demos/shaft_on_bearings.toml
# :language: toml
# ```
#
# Three keys make a shaft of a beam. `axis = [1, 0, 0]` spins it about its own axis. `root = { driven = true }` lets
# the
# drive hold it along and about that axis alone. `supports` are the bearings, springs (and dampers) to the fixed
# frame.
#
# On the command line the whole computation is `rotfem campbell demos/shaft_on_bearings.toml --speeds 0:400:9`.

# %%
import rotfem

diagram = rotfem.campbell("../../demos/shaft_on_bearings.toml", "0:400:9")
for critical in diagram.critical_speeds:
    if critical.kind != "per_rev":
        print(f"{critical.kind:8s} whirl, {critical.label:20s} {critical.speed:8.3f} rad/s")

# %% [markdown]
# A shaft whirls forward, with its spin, or backward. Gyroscopic moments of the disks raise the frequency of the one
# and
# lower that of the other. An unbalance turns with the shaft and drives forward whirl: the forward critical speed is
# the
# one to stay away from. A force that rests in space drives the backward one.
#
# The shaft is the same in all directions, so that frequencies are those in the fixed frame. Both whirls meet the
# line 1Ω.

# %%
diagram.plot()

# %% [markdown]
# ## How far does it whirl?
#
# A gram at 1 m, or 1 kg mm, off the axis of the first disk, and bearings with some damping: one linear solution
# at each
# speed gives the orbits of the shaft, and the forces on its bearings. A peak has its amplification factor, as API
# 617 defines it.

# %%
damped = [{"x": x, "stiffness": 1e6, "damping": 2e3} for x in (0.0, 1.5)]
scene = rotfem.load_scene("../../demos/shaft_on_bearings.toml")
scene = scene.replace({"structure.supports": damped, "loads.unbalance": [{"x": 0.5, "kg_m": 1e-3}]})
whirl = rotfem.unbalance(scene, "20:400:77", operating=(150.0, 200.0))
for peak in whirl.summary["peaks"][:2]:
    print(f"x = {peak['x']} m: {peak['major']:.3e} m at {peak['speed']:.2f} rad/s, factor {peak['amplification']}")

# %%
whirl.plot()

# %%
whirl.plot(drawing="unbalance_orbits")

# %% [markdown]
# ## Is it right?
#
# ROSS 2.3.0 with 48 Timoshenko elements has its first forward critical speed at 96.49728647 rad/s.

# %%
first = next(c.speed for c in diagram.critical_speeds if c.kind == "forward")
print(f"{first:.6f} rad/s, ROSS 96.497286 rad/s")
assert abs(first - 96.49728647) < 1e-4
