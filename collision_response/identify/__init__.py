"""Coefficients of impact laws from measured impacts.

    >>> from collision_response import Body, Contact, Law, Twist, resolve
    >>> from collision_response.identify import Impacts, identify
    >>> wall, contact = Body.static(), Contact.of((0, 0, 0), (0, 0, 1), restitution=0.6)
    >>> balls = [Body.dynamic(1.0, velocity=(0.0, 0.0, -v)) for v in (1.0, 2.0, 3.0)]
    >>> after = [resolve(ball, wall, contact).twist_a for ball in balls]
    >>> impacts = Impacts.of(balls, [wall] * 3, [contact] * 3, after, after)
    >>> round(identify(impacts, Law.FRICTIONLESS).coefficients["restitution"].value, 6)
    0.6

It needs SciPy.
"""

from .compare import Comparison, compare
from .estimates import Estimate
from .identification import Identification, identify
from .measurements import Impacts
from .sphere_readings import SphereReadings

__all__ = ["Comparison", "Estimate", "Identification", "Impacts", "SphereReadings", "compare", "identify"]
