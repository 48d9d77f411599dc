"""An effect of a user's own: linear drag of the air, a force that is no acceleration.

With the absolute velocity v = ẋ + w×x of the axis the force per length is −c v; its term in the residual is
+ ∫ c v·δx. Said once for a free variation, it acts on the structure and on a free hub alike.
"""

import ufl

from rotfem import Effect, register

#: c, N·s/m².
DRAG = 0.05


def work(m, delta):
    """∫ c v·δx along the axis."""
    return sum(DRAG * ufl.inner(m.velocity(body), delta.of(body)) * body.measure for body in m.positions())


register(Effect("drag", work, reasons=("there is air", "there is none")))
