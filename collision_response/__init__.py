"""Collision response: two bodies and a contact in, the twists after the impact out.

    >>> from collision_response import Body, Contact, resolve
    >>> ball = Body.dynamic(mass=1.0, velocity=(0.0, 0.0, -2.0))
    >>> contact = Contact.of((0, 0, 0), normal=(0, 0, 1), restitution=0.5)
    >>> resolve(ball, Body.static(), contact).twist_a.linear.z
    1.0

The package needs only NumPy. The node in :mod:`collision_response.ros` also needs ROS, recordings need rerun,
and results of precision EXTENDED that take more than 32 digits need python-flint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .answer import Impact
from .model import Adjustment, Geometry, ImpactModel, Precision
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.laws import Law, Regime
from .physics.vector import Vec3
from .requirements import SceneContact, SceneRequirements, scene_requirements
from .resolve import resolve
from .resolve_contact import ContactImpact, resolve_contact
from .scene import SceneImpact, resolve_scene
from .status import ImpactError, StatusCode

__all__ = [
    "Adjustment",
    "Body",
    "Contact",
    "ContactImpact",
    "Geometry",
    "Impact",
    "ImpactError",
    "ImpactModel",
    "Law",
    "Precision",
    "Regime",
    "SceneContact",
    "SceneImpact",
    "SceneRequirements",
    "StatusCode",
    "Twist",
    "Vec3",
    "resolve",
    "resolve_contact",
    "resolve_scene",
    "scene_requirements",
]


__version__: str

if not TYPE_CHECKING:  # type checkers would take any name for one that it finds

    def __getattr__(name):
        """Look up ``__version__`` in pip's metadata, or in the ``package.xml`` that colcon installed."""
        if name != "__version__":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from contextlib import suppress
        from importlib import metadata
        from pathlib import Path

        with suppress(metadata.PackageNotFoundError):
            return metadata.version(__name__)
        description = Path(__file__).parents[4] / "share" / __name__ / "package.xml"
        return description.read_text().partition("<version>")[2].partition("</version>")[0]
