"""A theory of a user's own, for planar beams only: the axial strain of von Kármán's plates, u₁' + ½ u₂'².

It differs from the stretch √((1 + u₁')² + u₂'²) − 1 of `von_karman` by terms of third order.
"""

from rotfem import Theory, register


def planar_beam(q):
    """Γ₁ = u₁' + ½ u₂'², Γ₂ = u₂' − α, κ = α'."""
    du1, du2, dalpha = (q[i].dx(0) for i in range(3))
    return du1 + du2**2 / 2, du2 - q[2], dalpha


register(Theory("half_square", 3.5, {"planar_beam": planar_beam}))
