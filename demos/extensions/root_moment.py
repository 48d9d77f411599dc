"""An output of a user's own: the bending moment EI α' at the clamp of a planar beam, N·m."""

from rotfem import Output, register


def form(m):
    """EI α' at X = 0."""
    return m.resultant("bending") * m.structure.root


register(Output("root_moment", form, "N·m"))
